#version 460
// The figures of a tile of node slots: see bvh/quality.glsl for the contract.
#include "bvh/quality.glsl"

// As many subgroups as there may be: they may be smaller than the device reports.
shared Figures partial[gl_WorkGroupSize.x];

// The figures of the node at `slot` and of the leaves below it; none if it is not part of the tree.
Figures figures_of(uint slot, Child root, float scale) {
    Figures f = no_figures();
    uint depth = 0;
    uint at = slot;
    while (at != root.index && depth < MAX_DEPTH) {
        at = parents.word[at];
        if (at == NONE) return f;
        depth += 1;
    }
    if (at != root.index) return f;
    Child left = structure.nodes[slot].left, right = structure.nodes[slot].right;
    f.inner = 1;
    f.inner_area = relative_area(min(left.lo, right.lo), max(left.hi, right.hi), scale);
    if (left.count != 0) count_leaf(f, left, depth + 1, scale);
    if (right.count != 0) count_leaf(f, right, depth + 1, scale);
    return f;
}

void main() {
    Child root = structure.header.root;
    uint slots = structure.header.active_count == 0 || root.count != 0 ? 0 : structure.header.node_slots;
    float scale = scale_of(root);
    uint first = group_number() * gl_WorkGroupSize.x * rounds + gl_LocalInvocationIndex;
    Figures sum = no_figures();
    for (uint round = 0; round < rounds; ++round) {
        uint slot = first + round * gl_WorkGroupSize.x;
        if (slot < slots) add(sum, figures_of(slot, root, scale));
    }
    // A tile's leaves have fewer than 2^32 levels in all: the low words are enough here.
    sum.inner_area = subgroupAdd(sum.inner_area);
    sum.leaf_area = subgroupAdd(sum.leaf_area);
    sum.inner = subgroupAdd(sum.inner);
    sum.leaves = subgroupAdd(sum.leaves);
    sum.refs = subgroupAdd(sum.refs);
    sum.leaf_max = subgroupMax(sum.leaf_max);
    sum.depth_sum[0] = subgroupAdd(sum.depth_sum[0]);
    sum.depth_max = subgroupMax(sum.depth_max);
    if (subgroupElect()) partial[gl_SubgroupID] = sum;
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        for (uint s = 1; s < gl_NumSubgroups; ++s) add(sum, partial[s]);
        partials.tile[group_number()] = sum;
    }
}
