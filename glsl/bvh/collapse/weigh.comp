#version 460
// Counts and costs of all nodes, bottom-up: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    collapse_weigh(group_number());
}
