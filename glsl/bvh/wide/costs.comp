#version 460
// What subtrees cost in so many places, from the leaves up: see bvh/wide/costs.glsl for the contract.
#include "bvh/wide/costs.glsl"

void main() {
    climb(slots_in_use());
}
