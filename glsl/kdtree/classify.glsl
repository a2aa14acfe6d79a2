// What a plane makes of the references of a task, and where it goes: see kdtree/builder.glsl.
#ifndef HEDGEROW_KDTREE_CLASSIFY
#define HEDGEROW_KDTREE_CLASSIFY
#include "kdtree/bin.glsl"
#include "kdtree/clip.glsl"

// Of a reference: whether it is on the left, on the right, and behind them, one more than where its part on the right waits.
const uint IS_LEFT = 1;
const uint IS_RIGHT = 2;

// References that are classified at a time: those that straddle the plane are listed in shared memory.
const uint BLOCK = CHUNK < 512u ? CHUNK : 512u;

shared uint straddling[BLOCK];
shared uint part_is_there[gl_WorkGroupSize.x];

// Parts on the right wait at the end of the level's references, the last first.
uint waiting_place(uint k) {
    return reference_capacity - 1u - k;
}

// The parts of what straddles the plane: an invocation a side. Side by side, so that each sees what the other has found. Those on the
// right wait at `last_place` and before it. Adds to what the invocation has found on either side.
void clip_straddling(KdReferences references, uint count, uint last_place, bool fits, Box cell, uint axis, float plane, inout uvec2 found) {
    float reach = build_state().reach;
    Words all_sides = Words(build_state().sides);
    Box halves[2];
    half_cells(cell, axis, plane, halves[0], halves[1]);
    for (uint base = 0; base < 2u * count; base += gl_WorkGroupSize.x) {
        uint item = base + gl_LocalInvocationIndex, side = item & 1u;
        bool is_item = item < 2u * count;
        uint i = is_item ? straddling[item >> 1] : 0u;
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
            uint waits = last_place - (item >> 1);
            bool takes = is_there || !other_is_there;
            if (side == 0u) {
                bool right = other_is_there || !is_there;
                if (takes) {
                    references.reference[i].lo = part.lo;
                    references.reference[i].hi = part.hi;
                }
                all_sides.word[i] = (takes ? IS_LEFT : 0u) | (right ? IS_RIGHT : 0u) | waits + 1u << 2;
                found += uvec2(takes ? 1u : 0u, right ? 1u : 0u);
            } else if (takes && fits) {
                references.reference[waits].lo = part.lo;
                references.reference[waits].hi = part.hi;
            }
        }
        barrier();
    }
}

// The sides of a block of references by a plane, but for those that straddle it: how many do, and are listed.
uint list_straddling(KdReferences references, uint begin, uint end, uint axis, float plane, bool planar_left, inout uvec2 found) {
    Words all_sides = Words(build_state().sides);
    uint straddlers = 0;
    for (uint base = begin; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        bvec2 is_there = bvec2(false);
        if (i < end) {
            Box b = Box(references.reference[i].lo, references.reference[i].hi);
            is_there = sides_of(b, axis, plane, planar_left);
        }
        uint total;
        uint at = straddlers + sum_before(all(is_there) ? 1u : 0u, total);
        if (all(is_there)) {
            straddling[at] = i;
        } else if (i < end) {
            all_sides.word[i] = (is_there.x ? IS_LEFT : 0u) | (is_there.y ? IS_RIGHT : 0u);
            found += uvec2(is_there.x ? 1u : 0u, is_there.y ? 1u : 0u);
        }
        straddlers += total;
    }
    barrier();
    return straddlers;
}

// The sides of a block of references by the plane of their task.
void classify_block(KdReferences references, uint begin, uint end, KdTask t, uint of_level, inout uvec2 found) {
    KdState state = build_state();
    uint axis = t.split & 3u;
    uint straddlers = list_straddling(references, begin, end, axis, t.plane, (t.split & SPLIT_LEFT_PLANAR) != 0u, found);
    if (straddlers == 0u) return;
    uint first_place = 0;
    if (gl_LocalInvocationIndex == 0u) first_place = atomicAdd(state.straddling[of_level], straddlers);
    first_place = agree(first_place);
    bool fits = first_place + straddlers <= reference_capacity - state.level_references[of_level];
    if (!fits && gl_LocalInvocationIndex == 0u) atomicOr(state.is_short, 1u);
    clip_straddling(references, straddlers, waiting_place(first_place), fits, Box(t.lo, t.hi), axis, t.plane, found);
}

void kd_classify_chunk(uint chunk, uint of_level) {
    KdState state = build_state();
    KdTasks tasks = tasks_of(of_level);
    KdReferences references = references_of(of_level);
    uint i = task_of_chunk(of_level, chunk);
    KdTask t = tasks.task[i];
    uint begin = t.begin + (chunk - t.first_chunk) * CHUNK, end = min(begin + CHUNK, t.begin + t.count);
    if ((t.split & ENDS) == 0u && t.counters == NONE) {
        Box cell = Box(t.lo, t.hi);
        fill_bins(references, cell, begin, end);
        settle(tasks, i, cell, t.count, best_of_bins(cell, state.area_scale, t.count));
        next_phase();
        t.split = tasks.task[i].split;
        t.plane = tasks.task[i].plane;
    }
    uvec2 found = uvec2(0), sides = uvec2(0);
    if ((t.split & SPLIT) != 0u) {
        for (uint block = begin; block < end; block += BLOCK) {
            classify_block(references, block, min(block + BLOCK, end), t, of_level, found);
        }
        sum_before(found, sides);
    }
    if (gl_LocalInvocationIndex == 0u) chunk_sides().side[chunk] = sides;
    barrier();
}
#endif
