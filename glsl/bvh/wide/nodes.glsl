// The step `nodes` of bvh/wide/collapse.glsl: every wide node to its index, and the header.
#ifndef HEDGEROW_BVH_WIDE_NODES
#define HEDGEROW_BVH_WIDE_NODES
#include "bvh/wide/collapse.glsl"
#include "bvh/wide/quantised.glsl"

uvec2 address_of_node(uint index) {
    return address_of(wide_nodes_at(target), index, wide_node_bytes(WIDTH, QUANTISED));
}

void write_empty_node() {
    if (QUANTISED) {
        QuantisedNodes(address_of_node(0)).node[0] = empty_quantised_node();
        return;
    }
    Child unused = Child(uintBitsToFloat(uvec3(0x7F800000u)), UNUSED, uintBitsToFloat(uvec3(0xFF800000u)), UNUSED);
    for (uint s = 0; s < WIDTH; ++s) Children(address_of_node(0)).child[s] = unused;
}

void write_header(bool there_is) {
    Header header = source.header;
    if (!is_binary(header)) header = header_of_wrong_version();
    header = compacted(header);
    uint nodes = there_is ? 1 + first_children.word[source_slots] : 0;
    header.kind = wide_kind(header.kind, WIDTH, QUANTISED);
    header.root.index = 0;
    header.root.count = 0;
    header.node_slots = max(nodes, 1);
    header.inner_nodes = nodes;
    header.pairs = there_is && is_paired() ? (UNITS_OF_ONE * header.active_count - first_records.word[source_slots]) / (2 * UNITS_OF_ONE - UNITS_OF_TWO) : 0;
    Structure(target).header = header;
    if (nodes == 0) write_empty_node();
}

void write_node(uint at, uint index, uint next_node) {
    Children node = Children(address_of_node(index));
    for (uint s = 0; s < WIDTH; ++s) {
        uint name = slots.word[at * WIDTH + s];
        Child child = Child(uintBitsToFloat(uvec3(0x7F800000u)), UNUSED, uintBitsToFloat(uvec3(0xFF800000u)), UNUSED);
        if (name != NO_CHILD) {
            child = child_named(name);
            if (is_inner(child)) child.index = next_node++;
        }
        node.child[s] = child;
    }
}

// The records of a leaf from a unit on; how many units they take.
uint place_leaf(Child leaf, uint first) {
    uint unit = first, end = min(leaf.index + leaf.count, source.header.primitive_count);
    for (uint r = leaf.index; r < end; ++r) {
        places.word[r] = unit;
        unit += is_paired() ? units_by_partner(partners.word[r]) : 1;
    }
    return unit - first;
}

void write_quantised_node(uint at, uint index, uint next_node, uint next_record) {
    vec3 lo = uintBitsToFloat(uvec3(0x7F800000u)), hi = uintBitsToFloat(uvec3(0xFF800000u));
    bool has_node = false, has_leaf = false;
    // The records of short leaves lie side by side; those of long ones, which are nodes of their own, before them.
    uint first_of_long = next_record;
    for (uint s = 0; s < 8; ++s) {
        uint name = slots.word[at * WIDTH + s];
        if (name == NO_CHILD) continue;
        Child child = child_named(name);
        lo = min(lo, child.lo);
        hi = max(hi, child.hi);
        bool is_node = is_wide_node(child);
        has_node = has_node || is_node;
        has_leaf = has_leaf || !is_node;
        if (is_node && !is_inner(child)) next_record += units_of_leaf(child);
    }
    QuantisedNode node = quantised_node_around(lo, hi, has_node ? next_node : 0, has_leaf ? next_record : 0);
    for (uint s = 0; s < 8; ++s) {
        uint name = slots.word[at * WIDTH + s];
        if (name == NO_CHILD) {
            put_into_slot(node, s, false, lo, hi, false, 0);
            continue;
        }
        Child child = child_named(name);
        bool is_node = is_wide_node(child);
        uint units = 0;
        if (!is_inner(child)) {
            uint first = is_node ? first_of_long : next_record;
            units = place_leaf(child, first);
            if (is_node) QuantisedNodes(address_of_node(next_node)).node[0] = long_leaf_node(first, units);
            if (is_node) first_of_long += units;
            else next_record += units;
        }
        put_into_slot(node, s, true, child.lo, child.hi, is_node, units);
        if (is_node) next_node++;
    }
    QuantisedNodes(address_of_node(index)).node[0] = node;
}

void write_nodes() {
    bool there_is = can_be_collapsed(source.header);
    if (invocation_number() == 0) write_header(there_is);
    uint count = levels.end;
    for (uint k = 0, at = grid_item(0); at < count; at = grid_item(++k)) {
        Opened o = opened.node[at];
        uint index = at == 0 ? 0 : 1 + first_children.word[o.place >> 3] + (o.place & 7u);
        uint next_node = 1 + first_children.word[o.slot];
        if (QUANTISED) write_quantised_node(at, index, next_node, first_records.word[o.slot]);
        else write_node(at, index, next_node);
    }
}
#endif
