#version 460
// The rounds that are left, until one cluster is; one workgroup: see bvh/ploc.glsl for the contract.
#include "bvh/ploc.glsl"

// The first that is not done, even or odd.
layout(constant_id = 8) const uint ROUND = 0;

void main() {
    ploc_finish(ROUND);
}
