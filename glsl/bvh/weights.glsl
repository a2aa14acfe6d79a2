// What a finished tree is made with, beside its nodes: for each node its parent, how many primitives lie below it and below its
// left child, and whether it is cheaper as a leaf. Builders that know these as they make a node write them (`weigh_node`);
// bvh/collapse.glsl finds them for any tree.
//
// A reference names a node by its slot, or a primitive by its sorted position with IS_PRIMITIVE set.
#ifndef HEDGEROW_BVH_WEIGHTS
#define HEDGEROW_BVH_WEIGHTS
#include "bvh/encode.glsl"

const uint IS_PRIMITIVE = 1u << 31;
// In the count of a node: it is cheaper as a leaf.
const uint IS_LEAF = 1u << 31;
const uint NO_PARENT = 0xFFFFFFFFu;

// Primitives below a node, and below its left child.
struct NodeCounts {
    uint all;             // IS_LEAF in the top bit
    uint left;
};

// They lie at multiples of 8, so that src/gpu/longs.rs may take both at a time.
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer CountsOfNodes { NodeCounts node[]; };

struct Weights {
    Words parents;        // of the slots, then of the positions: slot * 2, + 1 for a right child; NO_PARENT
    CountsOfNodes counts;
};

Weights weights() {
    uvec2 begin = part(parts.weights);
    return Weights(Words(begin), CountsOfNodes(address_of(begin, primitive_count, 8u)));
}

uint parent_at(uint reference) {
    return (reference & IS_PRIMITIVE) != 0u ? primitive_count + (reference & ~IS_PRIMITIVE) : reference;
}

uint reference_of(Child child) {
    return child.count != 0u ? child.index | IS_PRIMITIVE : child.index;
}

// The words of the child that a link names, or of the header's root: at 64-bit addresses, for a tree may have over 2^31 bytes.
Words child_words(uint link) {
    uvec2 root = address_of(structure_address, 1u, 16u);
    return Words(link == NO_PARENT ? root : address_of(structure_address, link + 4u, 32u));
}

// In a child.
const uint INDEX_WORD = 3;
const uint COUNT_WORD = 7;

// Writes what is known of a node over two subtrees of these counts and costs, with the area around both; returns its cost.
float weigh_node(Weights w, uint slot, uvec2 children_counts, vec2 children_costs, float area) {
    uint count = children_counts.x + children_counts.y;
    float as_leaf = leaf_cost(c_i, area, count);
    float as_inner = inner_cost(c_t, area, children_costs.x, children_costs.y);
    bool is_leaf = collapses != 0u && as_leaf < as_inner;
    w.counts.node[slot] = NodeCounts(count | (is_leaf ? IS_LEAF : 0u), children_counts.x);
    return is_leaf ? as_leaf : as_inner;
}
#endif
