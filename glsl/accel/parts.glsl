// The parts of a structure below a top level, as a binary tree: what instances are opened to, and what their boxes are made of. The twin
// is `Below` in src/accel/twin/mod.rs.
//
// A part is a Child. Of quantised nodes it is some of a node's slots, and `count` says which, a bit each: a node is cut in two along the
// axis where that leaves least area, as the bits of a slot's number are the octant that it lies in. A part of one slot that holds a node is
// that node, whole.
#ifndef HEDGEROW_ACCEL_PARTS
#define HEDGEROW_ACCEL_PARTS
#include "bvh/instances.glsl"
#include "bvh/wide.glsl"
#include "trace/quantised_slots.glsl"

Box empty_box() {
    return Box(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
}

Box united(Box a, Box b) {
    return Box(min(a.lo, b.lo), max(a.hi, b.hi));
}

float half_area(Box b) {
    precise vec3 e = b.hi - b.lo;
    precise float area = e.x * e.y + e.y * e.z + e.z * e.x;
    return area;
}

// All that a structure holds. `slots` are those of an Entry.
Child whole_part(Header header) {
    Child root = header.root;
    if (is_quantised(header.kind)) root.count = ALL_SLOTS;
    return root;
}

// The box in a slot of a quantised node.
Box box_in_slot(QuantisedNode node, uint slot) {
    uint e = node.exponents_and_nodes;
    vec3 cell = uintBitsToFloat((uvec3(e, e >> 8, e >> 16) & 0xFFu) << 23);
    vec3 lo = vec3(byte_of_slot(node.lo[0], slot), byte_of_slot(node.lo[1], slot), byte_of_slot(node.lo[2], slot));
    vec3 hi = vec3(byte_of_slot(node.hi[0], slot), byte_of_slot(node.hi[1], slot), byte_of_slot(node.hi[2], slot));
    precise vec3 least = uintBitsToFloat(node.origin) + lo * cell;
    precise vec3 greatest = uintBitsToFloat(node.origin) + hi * cell;
    return Box(least, greatest);
}

Box box_in_slots(QuantisedNode node, uint slots) {
    Box b = empty_box();
    for (uint slot = 0; slot < 8; ++slot) {
        if ((slots >> slot & 1u) != 0u) b = united(b, box_in_slot(node, slot));
    }
    return b;
}

// Which slots of a quantised node hold anything.
uint slots_in_use(QuantisedNode node) {
    uint used = node.exponents_and_nodes >> 24;
    for (uint slot = 0; slot < 8; ++slot) {
        if (byte_of_slot(node.counts, slot) != 0u) used |= 1u << slot;
    }
    return used;
}

Child part_of_node(QuantisedNode node, uint index, uint slots) {
    Box b = box_in_slots(node, slots);
    uint nodes = node.exponents_and_nodes >> 24;
    if (bitCount(slots) == 1 && (slots & nodes) != 0u) {
        return Child(b.lo, node.first_child + rank_of_node(nodes, uint(findLSB(slots))), b.hi, ALL_SLOTS);
    }
    return Child(b.lo, index, b.hi, slots);
}

// The slots whose numbers have a bit of an axis.
uint slots_beyond(uint axis) {
    return axis == 0u ? 0xAAu : axis == 1u ? 0xCCu : 0xF0u;
}

bool open_quantised(Structure structure, Child part, out Child parts[2]) {
    QuantisedNode node = QuantisedNodes(wide_nodes_at(uvec2(structure))).node[part.index];
    parts[0] = part;
    parts[1] = part;
    if (node.exponents_and_nodes == LONG_LEAF) return false;
    uint slots = part.count & slots_in_use(node);
    if (bitCount(slots) < 2) return false;
    uint best = 0u;
    float least = 0.0;
    for (uint axis = 0; axis < 3; ++axis) {
        uint beyond = slots & slots_beyond(axis);
        if (beyond == 0u || beyond == slots) continue;
        precise float area = half_area(box_in_slots(node, slots & ~beyond)) + half_area(box_in_slots(node, beyond));
        if (best == 0u || area < least) {
            best = beyond;
            least = area;
        }
    }
    parts[0] = part_of_node(node, part.index, slots & ~best);
    parts[1] = part_of_node(node, part.index, best);
    return true;
}

// The two parts of a part; of what cannot be opened twice itself, and false. `slots` are those of an Entry.
bool open_child(Structure structure, uint slots, Child child, out Child children[2]) {
    bool is_there = child.index < (slots & INDEX_MASK);
    children[0] = child;
    children[1] = child;
    if ((slots & FORM_QUANTISED) != 0u) return is_there && open_quantised(structure, child, children);
    bool opens = child.count == 0u && is_there;
    if (opens) {
        Node node = structure.nodes[child.index];
        children[0] = node.left;
        children[1] = node.right;
    }
    return opens;
}
#endif
