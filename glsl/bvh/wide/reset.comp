#version 460
// The root as the only node of the first level: see bvh/wide/collapse.glsl for the contract.
#include "bvh/wide/open.glsl"

void main() {
    reset();
}
