// The step `match` of bvh/reinsertion.glsl: on each node, the first of the moves with the largest gain.
#ifndef HEDGEROW_BVH_REINSERTION_MATCH
#define HEDGEROW_BVH_REINSERTION_MATCH
#include "bvh/reinsertion.glsl"

void match_moves() {
    for (uint k = 0, i = grid_item(0); i < tried(); i = grid_item(++k)) {
        Move m = moves.move[i];
        if (m.to == NONE) continue;
        for (Path path = path_of(link_of(i), m); path.slot != NONE; advance(path)) {
            if (gains.word[path.slot] == rank_of_gain(m.gain)) atomicMax(firsts.word[path.slot], rank_of_link(link_of(i)));
        }
    }
}
#endif
