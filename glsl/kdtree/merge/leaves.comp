#version 460
// The numbers and first pairs of the leaves that triangles of objects are in; workgroups share the tiles. See kdtree/merge.glsl.
#include "kdtree/merge/mark.glsl"

void main() {
    KdMerge merge = merge_state();
    KdMarkedLeaves leaves = marked_leaves();
    uint pairs = pair_count();
    for (uint tile = group_number(); tile < tiles_of(pairs); tile += gl_NumWorkGroups.x) {
        uint end = min(tile * TILE + TILE, pairs), marked = Words(merge.pair_tiles).word[tile];
        for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
            uint i = base + gl_LocalInvocationIndex;
            bool marks = i < end && is_first(i);
            uint at = add_all(marked, marks ? 1u : 0u);
            if (marks && at < merge.marked_capacity) {
                leaves.leaf[at].id = id_of_key(i);
                leaves.leaf[at].first = i;
            }
        }
    }
}
