#version 460
// State to begin with: see bvh/split.glsl for the contract.
#include "bvh/split.glsl"

void main() {
    reset_split();
}
