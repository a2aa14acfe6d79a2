#version 460
// Where things of a merge lie, and the static tree's header to where it is kept; one workgroup. See kdtree/merge.glsl.
#include "kdtree/merge/setup.glsl"

void main() {
    if (gl_LocalInvocationIndex != 0u) return;
    KdMerge merge = KdMerge(address_of(state_address, 1u, MERGE_AT));
    merge.undo = undo;
    merge.pairs = pairs;
    uint sorted = key_words_and_sorted >> 2, unique = seed_count > 0u ? 1u - sorted : sorted;
    merge.keys = keys[0];
    merge.values = values[0];
    merge.sorted_keys = keys[sorted];
    merge.sorted_values = values[sorted];
    merge.unique_keys = keys[unique];
    merge.unique_values = values[unique];
    merge.pair_tiles = pair_tiles;
    merge.marked = marked;
    merge.seeds = seeds;
    merge.items = items;
    merge.pair_capacity = pair_capacity;
    merge.marked_capacity = marked_capacity;
    merge.record_bits = record_bits;
    merge.key_words = key_words_and_sorted & 3u;
    merge.tiles = tiles;
    merge.primitive_end = primitive_end;
    merge.seed_count = seed_count;
    merge.item_capacity = item_capacity;
    merge.status = 0u;
    merge.wanted_pairs = 0u;
    merge.wanted_marked = 0u;
    merge.unique_tiles = 0u;
    merge.marked_tiles = 0u;
    merge.described_tiles = 0u;
    merge.equal_pairs = 0u;
    merge.met_count = 0u;
    merge.wanted_items = 0u;
    merge.items_ended = 0u;
    for (uint i = 0; i < 3u; ++i) merge.item_count[i] = 0u;
    KdUndo(undo).header = KdStructure(structure_address).header;
    KdUndo(undo).count = 0u;
}
