#version 460
// Records in the order of the walk: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    collapse_records(group_number());
}
