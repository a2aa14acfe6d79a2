#version 460
// A cluster of each primitive: see bvh/ploc.glsl for the contract.
#include "bvh/ploc.glsl"

void main() {
    ploc_begin(group_number());
}
