// The references of a task go to its children, or to its leaf: see kdtree/build.glsl.
#ifndef HEDGEROW_KDTREE_DISTRIBUTE
#define HEDGEROW_KDTREE_DISTRIBUTE
#include "kdtree/classify.glsl"

Words leaf_references() {
    return Words(kd_references_at(structure_address, node_room));
}

void kd_distribute_chunk(uint chunk, uint of_level) {
    KdTasks tasks = tasks_of(of_level);
    KdReferences from = references_of(of_level), to = references_of(of_level + 1u);
    KdTask t = tasks.task[task_of_chunk(of_level, chunk)];
    uint begin = t.begin + (chunk - t.first_chunk) * CHUNK, end = min(begin + CHUNK, t.begin + t.count);
    if ((t.split & SPLIT) == 0u) {
        Words leaf = leaf_references();
        for (uint i = begin + gl_LocalInvocationIndex; i < end; i += gl_WorkGroupSize.x) {
            leaf.word[t.leaf + (i - t.begin)] = from.reference[i].record;
        }
        return;
    }
    Words sides = Words(build_state().sides);
    uvec2 at = uvec2(t.left, t.right) + chunk_sides().side[chunk] - chunk_sides().side[t.first_chunk];
    for (uint base = begin; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uint side = i < end ? sides.word[i] : 0u;
        uvec2 total;
        uint left = at.x + sum_before(side & IS_LEFT, total.x);
        uint right = at.y + sum_before(side >> 1 & 1u, total.y);
        if (side != 0u) {
            KdReference own = from.reference[i];
            if ((side & IS_LEFT) != 0u) to.reference[left] = own;
            if ((side & IS_RIGHT) != 0u) {
                uint waits = side >> 2;
                if (waits != 0u) {
                    own.lo = from.reference[waits - 1u].lo;
                    own.hi = from.reference[waits - 1u].hi;
                }
                to.reference[right] = own;
            }
        }
        at += total;
    }
}

// Leaves of few references, an invocation each.
void kd_distribute_leaves(uint tile, uint of_level) {
    KdTasks tasks = tasks_of(of_level);
    uint i = tile * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i >= build_state().task_count[of_level]) return;
    KdTask t = tasks.task[i];
    if ((t.split & LARGE) != 0u || (t.split & ENDS) == 0u) return;
    KdReferences from = references_of(of_level);
    for (uint k = 0; k < t.count; ++k) leaf_references().word[t.leaf + k] = from.reference[t.begin + k].record;
}
#endif
