#version 460
// The exclusive scan of each tile, from its sum on: see gpu/scan.glsl for the contract.
#include "gpu/scan.glsl"

void main() {
    uint tile = group_number();
    uint tile_words = gl_WorkGroupSize.x * rounds;
    uint first = tile * tile_words;
    scan_range(values, results, first, min(count, first + tile_words), sums.word[tile], EACH);
}
