#version 460
// The sum of each tile: see gpu/scan.glsl for the contract.
#include "gpu/scan.glsl"

void main() {
    uint tile = group_number();
    uint tile_words = gl_WorkGroupSize.x * rounds;
    uint sum = 0;
    for (uint round = 0; round < rounds; ++round) {
        uint i = tile * tile_words + round * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        if (i < count) sum += values.word[i];
    }
    uint total;
    scan_workgroup(sum, total);
    if (gl_LocalInvocationIndex == 0) sums.word[tile] = total;
}
