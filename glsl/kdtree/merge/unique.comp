#version 460
// How many of the sorted pairs are there once: a triangle is in several leaves of its object's tree; workgroups share the tiles. See
// kdtree/merge.glsl.
#include "kdtree/merge/mark.glsl"

void main() {
    KdMerge merge = merge_state();
    Words counts = Words(merge.pair_tiles);
    uint pairs = sorted_pairs(), tiles = tiles_of(pairs);
    for (uint tile = group_number(); tile < tiles; tile += gl_NumWorkGroups.x) {
        uint end = min(tile * TILE + TILE, pairs), own = 0, count = 0, arrived = 0;
        for (uint i = tile * TILE + gl_LocalInvocationIndex; i < end; i += gl_WorkGroupSize.x) own += is_new(i) ? 1u : 0u;
        add_all(count, own);
        if (gl_LocalInvocationIndex == 0u) counts.word[tile] = count;
        release_workgroup();
        if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(merge.unique_tiles, 1u);
        if (is_last_of(arrived, tiles)) {
            scan_words(counts, 0u, 1u, tiles);
            if (gl_LocalInvocationIndex == 0u) merge.equal_pairs = pairs - counts.word[tiles];
        }
    }
}
