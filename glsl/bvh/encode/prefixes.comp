#version 460
// What the cells of the codes' grid say; one workgroup: see bvh/encode.glsl for the contract.
#include "bvh/encode.glsl"

void main() {
    find_prefixes();
}
