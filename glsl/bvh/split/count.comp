#version 460
// How many splits each triangle has: see bvh/split.glsl for the contract.
#include "bvh/split.glsl"

void main() {
    count_splits(group_number());
}
