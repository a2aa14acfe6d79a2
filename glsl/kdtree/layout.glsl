// The bytes of a KdTree, as src/kdtree/layout.rs describes them.
#ifndef HEDGEROW_KDTREE_LAYOUT
#define HEDGEROW_KDTREE_LAYOUT
#include "bvh/layout.glsl"

const uint KIND_KD_TREE = 0x00320006u;
const uint KD_MAX_DEPTH = 41;
const uint KD_MAX_NODES = 1u << 28;
const uint KD_MAX_REFERENCES = 1u << 30;

struct KdHeader {
    uint magic;
    uint kind;
    uint status;
    uint primitive_count;
    vec3 lo;
    uint node_count;
    vec3 hi;
    uint reference_count;
    uint active_count;
    uint inner_nodes;
    uint leaves;
    uint empty_leaves;
    uint geometry_count;
    uint geometry_flags;
    uint build_flags;
    uint depth;
    float area_scale;
    float reach;
    uint node_room;
    uint reference_room;
    uint record_room;
    uint replaced_nodes;
    uint replaced_references;
    uint reserved[5];
};

// An inner node: the plane's bits, then axis | left is empty << 2 | right is empty << 3 | first child that is not << 4.
// A leaf: how many references, then KD_LEAF | first of them << 2.
struct KdNode {
    uint first;
    uint second;
};

const uint KD_LEAF = 3;

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer KdStructure {
    KdHeader header;
    KdNode nodes[];
};

bool kd_is_leaf(KdNode node) {
    return (node.second & 3u) == KD_LEAF;
}

KdNode kd_leaf(uint first, uint count) {
    return KdNode(count, KD_LEAF | first << 2);
}

KdNode kd_inner(uint axis, float plane, uint first_child, bool left_is_empty, bool right_is_empty) {
    return KdNode(floatBitsToUint(plane), axis | (left_is_empty ? 4u : 0u) | (right_is_empty ? 8u : 0u) | first_child << 4);
}

// Where the references and the records of a structure begin.
uvec2 kd_references_at(uvec2 structure, uint node_room) {
    return address_of(address_of(structure, 1u, 128u), node_room, 8u);
}

uvec2 kd_records_at(uvec2 structure, uint node_room, uint reference_room) {
    return address_of(kd_references_at(structure, node_room), reference_room + 1u >> 1, 8u);
}

// Behind the records, where there are several geometries.
GeometryTable kd_geometries_at(uvec2 structure, uint node_room, uint reference_room, uint record_room) {
    return GeometryTable(address_of(kd_records_at(structure, node_room, reference_room), record_room, 40u));
}
#endif
