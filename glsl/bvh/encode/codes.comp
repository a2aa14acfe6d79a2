#version 460
// The code of every triangle: see bvh/encode.glsl for the contract.
#include "bvh/encode.glsl"

void main() {
    encode(group_number());
}
