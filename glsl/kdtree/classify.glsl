// What a plane makes of the references of a task, and where it goes: see kdtree/build.glsl.
#ifndef HEDGEROW_KDTREE_CLASSIFY
#define HEDGEROW_KDTREE_CLASSIFY
#include "kdtree/bin.glsl"
#include "kdtree/clip.glsl"

// Of a reference: whether it is on the left, on the right, and behind them, one more than where its part on the right waits.
const uint IS_LEFT = 1;
const uint IS_RIGHT = 2;

// Of the references of a chunk; and those that straddle the plane.
shared uint side_of[CHUNK];
shared uint straddling[CHUNK];
shared uint part_is_there[gl_WorkGroupSize.x];

// Parts on the right wait at the end of the level's references, the last first.
uint waiting_place(uint k) {
    return reference_capacity - 1u - k;
}

// The parts of what straddles the plane: an invocation a side. Side by side, so that each sees what the other has found.
void clip_straddling(KdReferences references, uint begin, uint count, uint first_place, bool fits, Box cell, uint axis, float plane) {
    float reach = build_state().reach;
    Box halves[2];
    half_cells(cell, axis, plane, halves[0], halves[1]);
    for (uint base = 0; base < 2u * count; base += gl_WorkGroupSize.x) {
        uint item = base + gl_LocalInvocationIndex, side = item & 1u;
        bool is_item = item < 2u * count;
        uint place = is_item ? straddling[item >> 1] : 0u;
        uint i = begin + place;
        Box whole = Box(vec3(0.0), vec3(0.0)), part = whole;
        bool is_there = false;
        if (is_item) {
            whole = Box(references.reference[i].lo, references.reference[i].hi);
            Box half_cell = halves[0];
            if (side == 1u) half_cell = halves[1];
            is_there = clip_triangle(corners_of_record(references.reference[i].record), reach, half_cell, part);
            part_is_there[gl_LocalInvocationIndex] = is_there ? 1u : 0u;
            // Rounding has it that the triangle is in neither.
            if (!is_there) part = common_part(whole, half_cell);
        }
        barrier();
        if (is_item) {
            bool other_is_there = part_is_there[gl_LocalInvocationIndex ^ 1u] == 1u;
            uint waits = waiting_place(first_place + (item >> 1));
            bool takes = is_there || !other_is_there;
            if (side == 0u) {
                bool right = other_is_there || !is_there;
                if (takes) {
                    references.reference[i].lo = part.lo;
                    references.reference[i].hi = part.hi;
                }
                side_of[place] = (takes ? IS_LEFT : 0u) | (right ? IS_RIGHT : 0u) | waits + 1u << 2;
            } else if (takes && fits) {
                references.reference[waits].lo = part.lo;
                references.reference[waits].hi = part.hi;
            }
        }
        barrier();
    }
}

void kd_classify_chunk(uint chunk, uint of_level) {
    KdState state = build_state();
    KdTasks tasks = tasks_of(of_level);
    KdReferences references = references_of(of_level);
    uint t = task_of_chunk(of_level, chunk);
    Box cell = Box(tasks.task[t].lo, tasks.task[t].hi);
    uint first = tasks.task[t].begin, count = tasks.task[t].count;
    uint own = chunk - tasks.task[t].first_chunk;
    uint begin = first + own * CHUNK, end = min(begin + CHUNK, first + count);
    if ((tasks.task[t].split & ENDS) == 0u && tasks.task[t].counters == NONE) {
        fill_bins(references, cell, begin, end);
        settle(tasks, t, cell, count, best_of_bins(cell, state.area_scale, count));
        next_step();
    }
    uint split = tasks.task[t].split;
    uvec2 sides = uvec2(0);
    if ((split & SPLIT) != 0u) {
        uint axis = split & 3u;
        float plane = tasks.task[t].plane;
        uint straddlers = 0;
        for (uint base = 0; base < end - begin; base += gl_WorkGroupSize.x) {
            uint place = base + gl_LocalInvocationIndex;
            bvec2 is_there = bvec2(false);
            if (begin + place < end) {
                Box b = Box(references.reference[begin + place].lo, references.reference[begin + place].hi);
                is_there = sides_of(b, axis, plane, (split & SPLIT_LEFT_PLANAR) != 0u);
                side_of[place] = (is_there.x ? IS_LEFT : 0u) | (is_there.y ? IS_RIGHT : 0u);
            }
            uint total;
            uint at = straddlers + sum_before(all(is_there) ? 1u : 0u, total);
            if (all(is_there)) straddling[at] = place;
            straddlers += total;
        }
        barrier();
        uint first_place = 0;
        if (straddlers > 0u) {
            if (gl_LocalInvocationIndex == 0u) first_place = atomicAdd(state.straddling[of_level], straddlers);
            first_place = agree(first_place);
        }
        bool fits = first_place + straddlers <= reference_capacity - state.level_references[of_level];
        if (!fits && gl_LocalInvocationIndex == 0u) atomicOr(state.is_short, 1u);
        clip_straddling(references, begin, straddlers, first_place, fits, cell, axis, plane);
        Words all_sides = Words(state.sides);
        uvec2 own_sides = uvec2(0);
        for (uint place = gl_LocalInvocationIndex; place < end - begin; place += gl_WorkGroupSize.x) {
            uint side = side_of[place];
            all_sides.word[begin + place] = side;
            own_sides += uvec2(side & 1u, side >> 1 & 1u);
        }
        uint total;
        sum_before(own_sides.x, total);
        sides.x = total;
        sum_before(own_sides.y, total);
        sides.y = total;
    }
    if (gl_LocalInvocationIndex == 0u) chunk_sides().side[chunk] = sides;
    barrier();
}
#endif
