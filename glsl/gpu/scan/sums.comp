#version 460
// The exclusive scan of the tiles' sums, with the total behind; one workgroup: see gpu/scan.glsl for the contract.
#include "gpu/scan.glsl"

void main() {
    uint tile_words = gl_WorkGroupSize.x * rounds;
    uint tiles = count / tile_words + (count % tile_words != 0 ? 1 : 0);
    uint total = scan_range(sums, sums, 0, tiles, 0, EACH);
    if (gl_LocalInvocationIndex == 0) sums.word[tiles] = total;
}
