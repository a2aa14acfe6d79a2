#version 460
// Leaves, and the order of a walk: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    collapse_place(group_number());
}
