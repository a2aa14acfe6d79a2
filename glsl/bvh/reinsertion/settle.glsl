// The step `settle` of bvh/reinsertion.glsl: leaves the moves that are first on all nodes of their path.
#ifndef HEDGEROW_BVH_REINSERTION_SETTLE
#define HEDGEROW_BVH_REINSERTION_SETTLE
#include "bvh/reinsertion.glsl"

void settle_moves() {
    for (uint k = 0, i = grid_item(0); i < tried(); i = grid_item(++k)) {
        Move m = moves.move[i];
        if (m.to == NONE) continue;
        bool is_first = true;
        for (Path path = path_of(link_of(i), m); path.slot != NONE && is_first; advance(path)) {
            is_first = firsts.word[path.slot] == rank_of_link(link_of(i));
        }
        if (!is_first) moves.move[i].to = NONE;
    }
}
#endif
