#version 460
// How many primitives lie in each cell of the codes' grid: see bvh/encode.glsl for the contract.
#include "bvh/encode.glsl"

void main() {
    count_cells(group_number());
}
