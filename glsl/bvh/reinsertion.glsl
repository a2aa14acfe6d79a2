// Parallel reinsertion: subtrees of a tree whose leaves have one record each move to where they cost less. src/bvh/reinsertion.rs
// describes the method and records the steps; src/bvh/twin/reinsertion.rs is the twin.
//
//   parents  reads nodes                        writes parents
//   (fill    writes gains, firsts: zero)
//   search   reads nodes, parents               writes moves, gains
//   match    reads parents, moves, gains        writes firsts
//   settle   reads parents, moves, firsts       writes moves: only those that are made are left
//   move     reads moves                        writes nodes, parents
//
// The first once, the others in each round, for every link of which offset + k · stride is one.
//
// needs  one barrier before, between each two, and after; any number of workgroups; any subgroup size
#ifndef HEDGEROW_BVH_REINSERTION
#define HEDGEROW_BVH_REINSERTION
#include "gpu/grid.glsl"
#include "bvh/layout.glsl"
#include "bvh/sah.glsl"

const uint NONE = 0xFFFFFFFFu;
// Nodes that a path may have on either side.
const uint PATH = 256;

// Of the subtree at link offset + k · stride, in the place k.
struct Move {
    uint to;       // a link; or none
    uint pivot;
    uint gain;     // the bits of a float: of positive ones, the order is the same
};

BUFFER Moves { Move move[]; };

layout(push_constant, scalar) uniform ReinsertionArguments {
    Structure structure;
    Words parents;      // of each slot, the link that names it
    Moves moves;
    Words gains;        // of the moves across each node, the largest gain
    Words firsts;       // and of those with it, the complement of the smallest link
    uint offset;
    uint stride;
    uint link_count;
};

uint link_of(uint k) {
    return offset + k * stride;
}

// How many links the round tries.
uint tried() {
    return offset < link_count ? (link_count - offset + stride - 1) / stride : 0;
}

Child child_at(uint link) {
    if ((link & 1u) == 0u) return structure.nodes[link >> 1].left;
    return structure.nodes[link >> 1].right;
}

Box box_of(Child child) {
    return Box(child.lo, child.hi);
}

Box around(Box a, Box b) {
    return Box(min(a.lo, b.lo), max(a.hi, b.hi));
}

// The node above another.
uint above(uint slot) {
    return parents.word[slot] >> 1;
}

// The nodes that a move changes: from the parent up to the pivot, and to the node above the parent in any case; and from the new
// place up to the pivot. To be walked as
//
//     for (Path path = path_of(link, m); path.slot != NONE; advance(path)) …
struct Path {
    uint slot;
    uint top;        // where the way up from the parent ends
    uint down;       // where the other way begins; NONE on that way
    uint pivot;
    uint steps;
};

uint top_of(uint link, Move m) {
    return m.pivot == link >> 1 ? above(m.pivot) : m.pivot;
}

Path path_of(uint link, Move m) {
    return Path(link >> 1, top_of(link, m), m.to >> 1, m.pivot, 0u);
}

void advance(inout Path path) {
    // No search gives longer ones.
    if (++path.steps > 2u * PATH + 2u) {
        path.slot = NONE;
        return;
    }
    if (path.down != NONE && path.slot == path.top) {
        path.slot = path.down;
        path.down = NONE;
    } else {
        path.slot = above(path.slot);
    }
    if (path.down == NONE && path.slot == path.pivot) path.slot = NONE;
}
#endif
