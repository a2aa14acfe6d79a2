// Clusters of PLOC and H-PLOC: subtrees that wait to be merged, in the order of their first primitives. There is
// one place a primitive. Of two that merge, the one before is the left child; the node's slot is the place before the
// right child's first primitive, which no other node can have: so slots do not depend on who merges first.
#ifndef HEDGEROW_BVH_CLUSTERS
#define HEDGEROW_BVH_CLUSTERS
#include "bvh/weights.glsl"

struct Cluster {
    vec3 lo;
    uint reference;
    vec3 hi;
    uint count;
    float cost;
    uint first;      // sorted position of its first primitive
};

// They lie at multiples of 8, so that src/gpu/longs.rs may take two words at a time.
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Clusters { Cluster cluster[]; };

// In units of 8 bytes.
const uint NODE_EIGHTHS = 8;
const uint LEAF_BOX_EIGHTHS = 3;

// In place of records they lie behind all boxes of leaves, which reach beyond the nodes where many triangles are left out. A single cluster
// may lie on them, for nobody else reads a box any more; with one of two triangles there is no room behind.
Clusters all_clusters() {
    if (!CLUSTERS_IN_RECORDS) return Clusters(part(parts.clusters));
    if (!HAS_PAIRS) return Clusters(records_of_tree());
    uint slots = Structure(structure_address).header.node_slots;
    uint begin = build_state().active_count < 2u ? 0u : max(NODE_EIGHTHS * slots, LEAF_BOX_EIGHTHS * primitive_count);
    return Clusters(address_of(uvec2(leaf_boxes()), begin, 8u));
}

// The cluster of the primitive at a sorted position.
Cluster cluster_of_primitive(Geometry input_geometries, uint position, float area_scale) {
    Box b;
    uint reference = sorted_values().word[position];
    load_reference(input_geometries, reference, b);
    uint count = triangles_of_pair(pair_of(reference));
    return Cluster(b.lo, position | IS_PRIMITIVE, b.hi, count, leaf_cost(c_i, scaled_half_area(b, area_scale), count), position);
}

Child child_of(Cluster c) {
    bool is_primitive = (c.reference & IS_PRIMITIVE) != 0u;
    return Child(c.lo, c.reference & ~IS_PRIMITIVE, c.hi, is_primitive ? c.count : 0u);
}

// A place in a list of clusters, or in the memory of all of them, that there is. Mesa 26's lavapipe loads what is at the same
// address for all lanes even where no lane is active: then too the address must be one.
uint safe_place(uint place) {
    return min(place, max(primitive_count, 1u) - 1u);
}

// The cluster that a list names, for lanes that all look at the same.
uint listed(Words list, uint i) {
    return safe_place(list.word[safe_place(i)]);
}

// The distance of two clusters: half the area of the box around both, whose edges are SHORTEST at least, so that the nearer of two
// on a line is the nearer.
float distance_of(Box a, Box b, float area_scale) {
    precise vec3 e = max(max(a.hi, b.hi) * area_scale - min(a.lo, b.lo) * area_scale, vec3(SHORTEST));
    precise float area = e.x * e.y + e.y * e.z + e.z * e.x;
    return area;
}

// Makes the node over two clusters.
Cluster merge_clusters(Structure structure, Weights w, Cluster left, Cluster right, float area_scale) {
    uint slot = right.first - 1u;
    structure.nodes[slot] = Node(child_of(left), child_of(right));
    w.parents.word[parent_at(left.reference)] = 2u * slot;
    w.parents.word[parent_at(right.reference)] = 2u * slot + 1u;
    vec3 lo = min(left.lo, right.lo), hi = max(left.hi, right.hi);
    float area = scaled_half_area(Box(lo, hi), area_scale);
    float cost = weigh_node(w, slot, uvec2(left.count, right.count), vec2(left.cost, right.cost), area);
    return Cluster(lo, slot, hi, left.count + right.count, cost, left.first);
}

// The last cluster is the tree.
void write_root(Structure structure, Weights w, Cluster c) {
    structure.header.root = child_of(c);
    structure.header.cost = c.cost;
    structure.header.built_cost = c.cost;
    w.parents.word[parent_at(c.reference)] = NO_PARENT;
}
#endif
