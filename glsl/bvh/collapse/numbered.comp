#version 460
// Records of a tree that has the numbers of its primitives in their place: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    collapse_numbered(group_number());
}
