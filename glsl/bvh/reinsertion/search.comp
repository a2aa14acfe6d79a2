#version 460
// The best move of each subtree, and its gain on all nodes of its path: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion/search.glsl"

void main() {
    begin_round(offset, since_fill);
    search_moves();
}
