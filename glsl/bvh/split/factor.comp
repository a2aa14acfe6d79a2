#version 460
// How many splits that gives, within the budget: see bvh/split.glsl for the contract.
#include "bvh/split.glsl"

void main() {
    find_factor();
}
