#version 460
// The recipe of the codes, and the header of the structure; one workgroup: see bvh/lbvh.glsl for the contract.
#include "bvh/lbvh.glsl"

void main() {
    lbvh_plan();
}
