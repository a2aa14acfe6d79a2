// The step `parents` of bvh/reinsertion.glsl: of each slot, the link that names it.
#ifndef HEDGEROW_BVH_REINSERTION_PARENTS
#define HEDGEROW_BVH_REINSERTION_PARENTS
#include "bvh/reinsertion.glsl"

void find_parents() {
    for (uint k = 0, slot = grid_item(0); slot < link_count / 2u; slot = grid_item(++k)) {
        if (!is_used(slot)) continue;
        Child left = structure.nodes[slot].left, right = structure.nodes[slot].right;
        if (left.count == 0u) parents.word[left.index] = 2u * slot;
        if (right.count == 0u) parents.word[right.index] = 2u * slot + 1u;
    }
}
#endif
