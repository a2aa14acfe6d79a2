#version 460
// What is known of each marked leaf, and whether there is room for all; workgroups share the tiles. See kdtree/merge.glsl.
#include "kdtree/merge/mark.glsl"

void main() {
    KdMerge merge = merge_state();
    uint marked = min(merge.wanted_marked, merge.marked_capacity), tiles = max(tiles_of(marked), 1u);
    for (uint tile = group_number(); tile < tiles; tile += gl_NumWorkGroups.x) {
        uint arrived = 0;
        if (marked > 0u) describe_tile(tile, marked);
        release_workgroup();
        if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(merge.described_tiles, 1u);
        if (is_last_of(arrived, tiles)) begin_merged(marked);
    }
}
