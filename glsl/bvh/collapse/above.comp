#version 460
// Where large nodes begin: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    collapse_above(group_number());
}
