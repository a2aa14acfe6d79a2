#version 460
// The parents of all nodes and primitives: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    collapse_parents(group_number());
}
