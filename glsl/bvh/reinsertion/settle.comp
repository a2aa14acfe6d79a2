#version 460
// Leaves the moves that are first on all nodes of their path: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion/settle.glsl"

void main() {
    begin_round(offset, since_fill);
    settle_moves();
}
