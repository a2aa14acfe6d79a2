#version 460
// How much each triangle deserves splits: see bvh/split.glsl for the contract.
#include "bvh/split.glsl"

void main() {
    weigh_triangles(group_number());
}
