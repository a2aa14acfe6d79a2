#version 460
// The box around the scene: see bvh/split.glsl for the contract.
#include "bvh/split.glsl"

void main() {
    find_split_bounds(group_number());
}
