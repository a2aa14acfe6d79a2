#version 460
// The code of every triangle: see bvh/lbvh.glsl for the contract.
#include "bvh/lbvh.glsl"

void main() {
    lbvh_encode(gl_WorkGroupID.x);
}
