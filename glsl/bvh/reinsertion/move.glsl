// The step `move` of bvh/reinsertion.glsl: makes the moves that are left, each on nodes that no other touches.
#ifndef HEDGEROW_BVH_REINSERTION_MOVE
#define HEDGEROW_BVH_REINSERTION_MOVE
#include "bvh/reinsertion.glsl"

void set_box(uint link, Box b) {
    if (BY_RAYS) costs.value[link] = cost_of(b, structure.header.area_scale, ratio());
    if ((link & 1u) == 0u) {
        structure.nodes[link >> 1].left.lo = b.lo;
        structure.nodes[link >> 1].left.hi = b.hi;
    } else {
        structure.nodes[link >> 1].right.lo = b.lo;
        structure.nodes[link >> 1].right.hi = b.hi;
    }
}

// Puts a subtree to a link, from another.
void hang(Child child, uint from, uint link) {
    if (BY_RAYS) costs.value[link] = costs.value[from];
    if ((link & 1u) == 0u) structure.nodes[link >> 1].left = child;
    else structure.nodes[link >> 1].right = child;
    if (child.count == 0u) parents.word[child.index] = link;
}

void make(uint link, Move m) {
    uint parent = link >> 1, top = top_of(link, m);
    uint up = parents.word[parent];
    Box moving = box_of(child_at(link));
    // The sibling takes the parent's place, and all up to the pivot shrink.
    hang(child_at(link ^ 1u), link ^ 1u, up);
    uint at = up;
    for (uint level = 0; level < PATH && at >> 1 != top; ++level) {
        Box b = box_of_node(at >> 1);
        at = parents.word[at >> 1];
        set_box(at, b);
    }
    // The parent takes the new place, with what was there as its other child, and all up to the pivot grow.
    Child there = child_at(m.to);
    hang(there, m.to, link ^ 1u);
    hang(Child(there.lo, parent, there.hi, 0u), m.to, m.to);
    at = m.to;
    for (uint level = 0; level <= PATH; ++level) {
        set_box(at, around(box_of(child_at(at)), moving));
        if (at >> 1 == top) break;
        at = parents.word[at >> 1];
    }
}

void make_moves() {
    if (grid_item(0) == 0u) {
        structure.header.child_order = 0u;
        structure.header.near_node = 0u;
        structure.header.far_sides = 0u;
    }
    for (uint k = 0, i = grid_item(0); i < tried(); i = grid_item(++k)) {
        Move m = moves.move[i];
        if (m.to != NONE) make(link_of(i), m);
    }
}
#endif
