#version 460
// Of each slot, the link that names it: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion/parents.glsl"

void main() {
    find_parents();
}
