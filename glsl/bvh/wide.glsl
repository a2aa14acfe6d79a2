// The bytes of wide trees, as src/bvh/wide/layout.rs describes them.
#ifndef HEDGEROW_BVH_WIDE
#define HEDGEROW_BVH_WIDE
#include "bvh/layout.glsl"

// Of the nodes of eight children as bytes: src/bvh/wide/quantised.rs.
struct QuantisedNode {
    uvec3 origin;                // bits of three floats
    uint exponents_and_nodes;
    uint first_child;
    uint first_record;
    uvec2 counts;
    uvec2 lo[3];
    uvec2 hi[3];
};

const uint QUANTISED_NODE_BYTES = 80;
// Exponents of a node that is a leaf of `first_child` records from `first_record` on.
const uint LONG_LEAF = 0x00FFFFFFu;
// Leaves of more records are such nodes.
const uint LEAF_MAX = 255;

// Nodes of floats: as many children as the tree is wide. A header is as long as so many.
const uint HEADER_CHILDREN = 4;
layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer Children { Child child[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer QuantisedNodes { QuantisedNode node[]; };

uint wide_kind(uint kind, uint width, bool quantised) {
    return kind & 0xFFF0FFFFu | width << 16 | (quantised ? 1u << 24 : 0u);
}

uint wide_node_bytes(uint width, bool quantised) {
    return quantised ? QUANTISED_NODE_BYTES : 32 * width;
}

uvec2 wide_nodes_at(uvec2 structure) {
    return address_of(structure, 1u, 128u);
}

// Where the records of a structure with this many nodes of this size begin: behind them.
uvec2 wide_records_at(uvec2 structure, uint node_slots, uint node_bytes) {
    return address_of(wide_nodes_at(structure), node_slots, node_bytes);
}
#endif
