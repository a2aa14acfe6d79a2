#version 460
// On each node, the first of the moves with the largest gain: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion.glsl"

void main() {
    for (uint k = 0, i = grid_item(0); i < tried(); i = grid_item(++k)) {
        Move m = moves.move[i];
        if (m.to == NONE) continue;
        for (Path path = path_of(link_of(i), m); path.slot != NONE; advance(path)) {
            if (gains.word[path.slot] == m.gain) atomicMax(firsts.word[path.slot], ~link_of(i));
        }
    }
}
