#version 460
// Makes the boxes above them again, bottom-up in one pass: see bvh/refit.glsl for the contract.
#include "bvh/refit.glsl"

void main() {
    refit_climb(updates[0], group_number());
}
