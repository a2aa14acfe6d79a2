#version 460
// On each node, the first of the moves with the largest gain: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion/match.glsl"

void main() {
    begin_round(offset, since_fill);
    match_moves();
}
