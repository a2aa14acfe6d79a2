#version 460
// Each of the sorted pairs once, to the memory that they were sorted from; workgroups share the tiles. See kdtree/merge.glsl.
#include "kdtree/merge/mark.glsl"

void main() {
    KdMerge merge = merge_state();
    Words keys = Words(merge.sorted_keys), values = Words(merge.sorted_values);
    Words to_keys = Words(merge.unique_keys), to_values = Words(merge.unique_values);
    uint pairs = sorted_pairs(), words = merge.key_words;
    for (uint tile = group_number(); tile < tiles_of(pairs); tile += gl_NumWorkGroups.x) {
        uint end = min(tile * TILE + TILE, pairs), kept = Words(merge.pair_tiles).word[tile];
        for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
            uint i = base + gl_LocalInvocationIndex;
            bool stays = i < end && is_new(i);
            uint at = add_all(kept, stays ? 1u : 0u);
            if (stays) {
                for (uint word = 0; word < words; ++word) to_keys.word[words * at + word] = keys.word[words * i + word];
                to_values.word[at] = values.word[i];
            }
        }
    }
}
