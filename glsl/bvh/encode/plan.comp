#version 460
// The recipe of the codes, and the header of the structure; one workgroup: see bvh/encode.glsl for the contract.
#include "bvh/encode.glsl"

void main() {
    make_plan();
}
