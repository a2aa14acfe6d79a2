#version 460
// Makes the moves that are left, each on nodes that no other touches: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion/move.glsl"

void main() {
    begin_round(offset, since_fill);
    make_moves();
}
