// The step `nodes` of bvh/wide/collapse.glsl: every wide node to its index, and the header.
#ifndef HEDGEROW_BVH_WIDE_NODES
#define HEDGEROW_BVH_WIDE_NODES
#include "bvh/wide/collapse.glsl"
#include "bvh/wide/far.glsl"
#include "bvh/wide/quantised.glsl"

// The nodes that wide nodes of lower blocks name.
uint nodes_before_block(uint block) {
    return blocks.word[nodes_of_block(block)];
}

// The units of records that wide nodes of lower blocks have. They are summed up as one with the nodes: all of those are what the first block
// begins with.
uint units_before_block(uint block) {
    return blocks.word[units_of_block(block)] - blocks.word[units_of_block(0)];
}

// Which slots of its block that are below a slot wide nodes begin with.
uint opened_below(uint slot) {
    return blocks.word[block_of(slot)] & bit_in_block(slot) - 1u;
}

// The nodes that wide nodes of lower slots name, and of quantised nodes the units of records that they have.
uvec2 all_before(uint slot) {
    uvec2 before = uvec2(nodes_before_block(block_of(slot)), QUANTISED ? units_before_block(block_of(slot)) : 0u);
    uint first = slot - slot % SLOTS_OF_BLOCK;
    for (uint below = opened_below(slot); below != 0u; below &= below - 1u) {
        uint other = first + uint(findLSB(below));
        before += uvec2(choices.word[other], QUANTISED ? units.word[other] : 0u);
    }
    return before;
}

void write_quantised(uint index, QuantisedNode node) {
    QuantisedNodes(wide_nodes_at(target)).node[index] = node;
}

void write_child(uint index, uint s, Child child) {
    Children(target).child[HEADER_CHILDREN + WIDTH * index + s] = child;
}

void write_empty_node() {
    if (QUANTISED) {
        write_quantised(0, empty_quantised_node());
        return;
    }
    Child unused = Child(uintBitsToFloat(uvec3(0x7F800000u)), UNUSED, uintBitsToFloat(uvec3(0xFF800000u)), UNUSED);
    for (uint s = 0; s < WIDTH; ++s) write_child(0, s, unused);
}

void write_header(bool there_is) {
    Header header = source.header;
    if (!is_binary(header)) header = header_of_wrong_version();
    header = compacted(header);
    uint nodes = there_is ? 1 + nodes_before_block(block_count()) : 0;
    // What is far is told of this tree.
    header.near_node = 0;
    header.far_sides = 0;
    header.kind = wide_kind(header.kind, WIDTH, QUANTISED);
    header.root.index = 0;
    header.root.count = 0;
    header.node_slots = max(nodes, 1);
    header.inner_nodes = nodes;
    header.pairs = there_is && is_paired() ? (UNITS_OF_ONE * header.active_count - units_before_block(block_count())) / (2 * UNITS_OF_ONE - UNITS_OF_TWO) : 0;
    Structure(target).header = header;
    if (nodes == 0) write_empty_node();
}

void write_node(uint at, uint index, uint next_node) {
    NextSlots all = slots_of(at);
    for (uint s = 0; s < WIDTH; ++s) {
        uint in_slot = take_slot(all);
        Child child = Child(uintBitsToFloat(uvec3(0x7F800000u)), UNUSED, uintBitsToFloat(uvec3(0xFF800000u)), UNUSED);
        if (in_slot != NO_CHILD) {
            child = child_in(in_slot);
            if (is_inner(child)) child.index = next_node++;
        }
        write_child(index, s, child);
    }
}

// The records of a leaf from a unit on; how many units they take.
uint place_leaf(Child leaf, uint first) {
    uint unit = first, end = end_of_leaf(leaf);
    for (uint r = leaf.index; r < end; ++r) {
        places.word[r] = unit;
        unit += is_paired() ? units_by_partner(partners.word[r]) : 1;
    }
    return unit - first;
}

void write_quantised_node(uint at, uint index, uint slot, uint next_node, uint next_record) {
    // The records of short leaves lie side by side; those of long ones, which are nodes of their own, before them.
    uint first_of_long = next_record;
    bool has_node = false, has_leaf = false;
    NextSlots all = slots_of(at), again = all;
    for (uint s = 0; s < 8; ++s) {
        uint in_slot = take_slot(again);
        has_node = has_node || is_node_in(in_slot);
        has_leaf = has_leaf || is_leaf_in(in_slot) && !is_long_leaf_in(in_slot);
        if (is_long_leaf_in(in_slot)) next_record += units_of_leaf(child_in(in_slot));
    }
    Box b = box_of_node(slot);
    uvec3 exponents = cell_exponents(b.lo, b.hi);
    uint first_child = has_node ? next_node : 0, first_record = has_leaf ? next_record : 0;
    SlotBytes bytes = NO_SLOT_BYTES;
    for (uint s = 0; s < 8; ++s) {
        uint in_slot = take_slot(all);
        uvec3 below = uvec3(255), above = uvec3(0);
        bool is_node = is_node_in(in_slot);
        uint units = 0;
        if (in_slot != NO_CHILD) {
            Child child = child_in(in_slot);
            if (is_leaf_in(in_slot)) {
                uint first = is_node ? first_of_long : next_record;
                units = place_leaf(child, first);
                if (is_node) write_quantised(next_node, long_leaf_node(first, units));
                if (is_node) first_of_long += units;
                else next_record += units;
            }
            if (is_node) next_node++;
            below = bytes_below(child.lo, b.lo, exponents);
            above = bytes_above(child.hi, b.lo, exponents);
        }
        put_into_next_slot(bytes, below, above, is_node, units);
    }
    write_quantised(index, quantised_node_of(bytes, b.lo, exponents, first_child, first_record));
}

void write_nodes() {
    bool there_is = can_be_collapsed(source.header);
    if (invocation_number() == 0) write_header(there_is);
    uint count = levels.end;
    for (uint k = 0, at = grid_item(0); at < count; at = grid_item(++k)) {
        Opened o = opened.node[at];
        uint index = at == 0 ? 0 : 1 + all_before(o.place >> 3).x + (o.place & 7u);
        uvec2 before = all_before(o.slot);
        uint next_node = 1 + before.x;
        if (QUANTISED) write_quantised_node(at, index, o.slot, next_node, before.y);
        else write_node(at, index, next_node);
        if (at == 0) tell_far(next_node);
    }
}
#endif
