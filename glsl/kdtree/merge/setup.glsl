// The arguments of what comes before a merge, and of what undoes it.
#ifndef HEDGEROW_KDTREE_MERGE_SETUP
#define HEDGEROW_KDTREE_MERGE_SETUP
#include "kdtree/merge/state.glsl"

layout(push_constant, scalar) uniform MergeSetupArguments {
    uvec2 structure_address;
    uvec2 state_address;
    uvec2 undo;
    uvec2 pairs;
    uvec2 keys[2];
    uvec2 values[2];
    uvec2 marked;
    uvec2 seeds;
    uvec2 items;
    uvec2 pair_tiles;
    uint pair_capacity;
    uint marked_capacity;
    uint record_bits;
    uint key_words_and_sorted;      // the number of words, and << 2, which of the keys and values are sorted
    uint tiles;
    uint primitive_end;
    uint seed_count;
    uint item_capacity;
};
#endif
