#version 460
// The planes to split at: see bvh/split.glsl for the contract.
#include "bvh/split.glsl"

void main() {
    make_grid();
}
