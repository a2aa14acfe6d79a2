// Min-max binning: src/kdtree/host/binned.rs is the twin. For each axis, one array counts the boxes that begin in a bin and another
// those that end there; sums of the first from the left are how many are on the left of a plane, sums of the second from the right
// how many on its right.
#ifndef HEDGEROW_KDTREE_BIN
#define HEDGEROW_KDTREE_BIN
#include "gpu/whole.glsl"
#include "kdtree/heuristic.glsl"

// Of each axis, bins in which boxes begin, then those in which they end.
const uint COUNTERS = 6 * BINS;

shared uint counters[COUNTERS];

// The planes between the bins: number i, from 1 on, is the end of bin i - 1 and the beginning of bin i.
struct BinPlanes {
    float lo;
    float width;
    float bins_per_length;
};

BinPlanes planes_of(Box cell, uint axis) {
    precise float width = (0.5 * cell.hi[axis] - 0.5 * cell.lo[axis]) * bin_part;
    return BinPlanes(cell.lo[axis], width, 1.0 / width);
}

float plane_at(BinPlanes planes, uint number) {
    precise float at = planes.lo + float(number) * planes.width;
    return at;
}

// A bin to begin with; which one has no say in the result.
uint bin_near(BinPlanes planes, float x) {
    return min(whole(clamp((x - planes.lo) * planes.bins_per_length, 0.0, float(BINS))), BINS - 1u);
}

// How many planes are not beyond x.
uint planes_not_beyond(BinPlanes planes, float x) {
    uint bin = bin_near(planes, x);
    for (uint i = 0; i < BINS && bin + 1u < BINS && plane_at(planes, bin + 1u) <= x; ++i) bin++;
    for (uint i = 0; i < BINS && bin > 0u && plane_at(planes, bin) > x; ++i) bin--;
    return bin;
}

// How many planes are before x.
uint planes_before(BinPlanes planes, float x) {
    uint bin = bin_near(planes, x);
    for (uint i = 0; i < BINS && bin + 1u < BINS && plane_at(planes, bin + 1u) < x; ++i) bin++;
    for (uint i = 0; i < BINS && bin > 0u && plane_at(planes, bin) >= x; ++i) bin--;
    return bin;
}

// Counts the faces of a number of references, from the first of them on.
void fill_bins(KdReferences references, Box cell, uint begin, uint end) {
    for (uint i = gl_LocalInvocationIndex; i < COUNTERS; i += gl_WorkGroupSize.x) counters[i] = 0u;
    barrier();
    for (uint i = begin + gl_LocalInvocationIndex; i < end; i += gl_WorkGroupSize.x) {
        Box b = Box(references.reference[i].lo, references.reference[i].hi);
        for (uint axis = 0; axis < 3; ++axis) {
            BinPlanes planes = planes_of(cell, axis);
            uint first = 2u * BINS * axis, bin_of_end = planes_before(planes, b.hi[axis]);
            // What lies in a plane is on its left.
            uint bin_of_begin = b.lo[axis] == b.hi[axis] ? bin_of_end : planes_not_beyond(planes, b.lo[axis]);
            atomicAdd(counters[first + bin_of_begin], 1u);
            atomicAdd(counters[first + BINS + bin_of_end], 1u);
        }
    }
    barrier();
}

// The best plane by what the counters say.
KdPlane best_of_bins(Box cell, float area_scale, uint count) {
    KdPlane best = no_plane();
    for (uint axis = 0; axis < 3; ++axis) {
        BinPlanes planes = planes_of(cell, axis);
        uint first = 2u * BINS * axis, left = 0, right = count;
        for (uint base = 0; base + 1u < BINS; base += gl_WorkGroupSize.x) {
            uint bin = base + gl_LocalInvocationIndex;
            uvec2 faces = uvec2(0), all_faces;
            if (bin < BINS) faces = uvec2(counters[first + bin], counters[first + BINS + bin]);
            uvec2 passed = faces + sum_before(faces, all_faces);
            uint own_left = left + passed.x, own_right = right - passed.y;
            left += all_faces.x;
            right -= all_faces.y;
            if (bin + 1u < BINS) {
                float at = plane_at(planes, bin + 1u);
                bool planar_left;
                uint cost = plane_cost(cell, area_scale, axis, at, uvec3(own_left, 0u, own_right), true, planar_left);
                KdPlane plane = KdPlane(cost, axis, ordered_float(positive_zero(at)), true);
                if (cost != INFINITE && is_better(plane, best)) best = plane;
            }
        }
    }
    return best_of_all(best);
}

// Notes what becomes of a task.
void settle(KdTasks tasks, uint i, Box cell, uint count, KdPlane best) {
    float area_scale = build_state().area_scale;
    if (gl_LocalInvocationIndex == 0u && best.cost != INFINITE && pays(best.cost, cell, area_scale, count)) {
        tasks.task[i].plane = float_of_ordered(best.place);
        tasks.task[i].split |= SPLIT | best.axis | (best.planar_left ? SPLIT_LEFT_PLANAR : 0u);
    }
}

// A chunk of a task of several.
void kd_bin_chunk(uint chunk, uint of_level) {
    KdState state = build_state();
    KdTasks tasks = tasks_of(of_level);
    uint i = task_of_chunk(of_level, chunk);
    if (tasks.task[i].counters == NONE) return;
    Box cell = Box(tasks.task[i].lo, tasks.task[i].hi);
    uint first = tasks.task[i].begin, count = tasks.task[i].count;
    uint own = chunk - tasks.task[i].first_chunk;
    uint begin = first + own * CHUNK, end = min(begin + CHUNK, first + count);
    fill_bins(references_of(of_level), cell, begin, end);
    // Behind the counters how many chunks have counted.
    Words all = Words(address_of(state.counters, tasks.task[i].counters, 4u * (COUNTERS + 1u)));
    for (uint c = gl_LocalInvocationIndex; c < COUNTERS; c += gl_WorkGroupSize.x) {
        if (counters[c] != 0u) atomicAdd(all.word[c], counters[c]);
    }
    release_workgroup();
    uint arrived = 0;
    if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(all.word[COUNTERS], 1u);
    if (!is_last_of(arrived, chunks_of(count))) return;
    for (uint c = gl_LocalInvocationIndex; c < COUNTERS; c += gl_WorkGroupSize.x) {
        counters[c] = all.word[c];
        all.word[c] = 0u;
    }
    if (gl_LocalInvocationIndex == 0u) all.word[COUNTERS] = 0u;
    barrier();
    settle(tasks, i, cell, count, best_of_bins(cell, state.area_scale, count));
}
#endif
