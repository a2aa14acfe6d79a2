#version 460
// Makes the records again, and the boxes of leaves: see bvh/refit.glsl for the contract.
#include "bvh/refit.glsl"

void main() {
    refit_leaves(updates[0], group_number());
}
