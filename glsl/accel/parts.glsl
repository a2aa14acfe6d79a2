// The parts of a structure below a top level, as a binary tree: what instances are opened to, and what their boxes are made of. The twin
// is `Below` in src/accel/twin/mod.rs.
//
// A part is a Child. Of quantised nodes it is some of a node's slots, and `count` says which, a bit each. A part of one slot that holds a node
// is that node, whole.
#ifndef HEDGEROW_ACCEL_PARTS
#define HEDGEROW_ACCEL_PARTS
#include "bvh/instances.glsl"
#include "bvh/wide.glsl"
#include "trace/quantised_slots.glsl"
#extension GL_EXT_control_flow_attributes : require

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

// Of all slots of a quantised node: in those that hold nothing, or that are not asked for, empty ones.
struct SlotBoxes {
    Box of[8];
};

SlotBoxes boxes_in_slots(QuantisedNode node, uint slots) {
    SlotBoxes boxes;
    // No loop: where shaderc unrolls one, the copies of what is `precise` are not.
#define BOX(slot)                                                                  \
    boxes.of[slot] = empty_box();                                                  \
    if ((slots >> slot & 1u) != 0u) boxes.of[slot] = box_in_slot(node, slot)
    BOX(0); BOX(1); BOX(2); BOX(3); BOX(4); BOX(5); BOX(6); BOX(7);
#undef BOX
    return boxes;
}

// Which slots of a quantised node hold anything.
uint slots_in_use(QuantisedNode node) {
    uint used = node.exponents_and_nodes >> 24;
    for (uint slot = 0; slot < 8; ++slot) {
        if (byte_of_slot(node.counts, slot) != 0u) used |= 1u << slot;
    }
    return used;
}

Child part_of_node(QuantisedNode node, Box b, uint index, uint slots) {
    uint nodes = node.exponents_and_nodes >> 24;
    if (bitCount(slots) == 1 && (slots & nodes) != 0u) {
        return Child(b.lo, node.first_child + rank_of_node(nodes, uint(findLSB(slots))), b.hi, ALL_SLOTS);
    }
    return Child(b.lo, index, b.hi, slots);
}

// How large a box is in the world, whichever way its instance turns it: about the square of the sum of its edges. By its own area two long
// halves of a long box would be as good as two short ones.
float size_of(Box b) {
    precise vec3 e = b.hi - b.lo;
    precise float edges = e.x + e.y + e.z;
    precise float size = edges * edges;
    return size;
}

// Some of the slots cut in two, the other part's slots and the boxes of both.
struct Cut {
    Box one;
    Box other;
    uint others;
};

// As Guttman (1984, section 3.5.2) splits a node of an R-tree: the two slots begin that together in one box would waste most, and each of the
// others goes to the part that grows less by it.
Cut cut_slots(QuantisedNode node, uint slots) {
    SlotBoxes boxes = boxes_in_slots(node, slots);
    float sizes[8];
#define SIZE(i) sizes[i] = size_of(boxes.of[i])
    SIZE(0); SIZE(1); SIZE(2); SIZE(3); SIZE(4); SIZE(5); SIZE(6); SIZE(7);
#undef SIZE
    float most = uintBitsToFloat(0xFF800000u);
    // The lowest two where sizes are too large for floats.
    uvec2 first = uvec2(findLSB(slots), findLSB(slots & slots - 1u));
#define LOOK(i, j)                                                                              \
    {                                                                                           \
        precise float waste = size_of(united(boxes.of[i], boxes.of[j])) - sizes[i] - sizes[j];  \
        bool wastes_more = (slots >> i & slots >> j & 1u) != 0u && waste > most;                \
        most = wastes_more ? waste : most;                                                      \
        first = wastes_more ? uvec2(i, j) : first;                                              \
    }
    LOOK(0, 1) LOOK(0, 2) LOOK(0, 3) LOOK(0, 4) LOOK(0, 5) LOOK(0, 6) LOOK(0, 7)
    LOOK(1, 2) LOOK(1, 3) LOOK(1, 4) LOOK(1, 5) LOOK(1, 6) LOOK(1, 7)
    LOOK(2, 3) LOOK(2, 4) LOOK(2, 5) LOOK(2, 6) LOOK(2, 7)
    LOOK(3, 4) LOOK(3, 5) LOOK(3, 6) LOOK(3, 7)
    LOOK(4, 5) LOOK(4, 6) LOOK(4, 7)
    LOOK(5, 6) LOOK(5, 7)
    LOOK(6, 7)
#undef LOOK
    Cut cut = Cut(boxes.of[0], boxes.of[0], 1u << first.y);
    [[unroll]] for (uint i = 1; i < 8; ++i) {
        if (first.x == i) cut.one = boxes.of[i];
        if (first.y == i) cut.other = boxes.of[i];
    }
    vec2 size = vec2(size_of(cut.one), size_of(cut.other));
#define JOIN(i)                                                                                 \
    {                                                                                           \
        Box one = united(cut.one, boxes.of[i]), other = united(cut.other, boxes.of[i]);         \
        vec2 joined = vec2(size_of(one), size_of(other));                                       \
        precise vec2 sum = joined + size.yx;                                                    \
        bool joins = (slots >> i & 1u) != 0u && i != first.x && i != first.y;                   \
        bool joins_other = joins && sum.y < sum.x;                                              \
        bool joins_one = joins && !joins_other;                                                 \
        if (joins_one) cut.one = one;                                                           \
        if (joins_other) cut.other = other;                                                     \
        size = vec2(joins_one ? joined.x : size.x, joins_other ? joined.y : size.y);            \
        cut.others |= joins_other ? 1u << i : 0u;                                               \
    }
    JOIN(0) JOIN(1) JOIN(2) JOIN(3) JOIN(4) JOIN(5) JOIN(6) JOIN(7)
#undef JOIN
    return cut;
}

bool open_quantised(Structure structure, Child part, out Child parts[2]) {
    QuantisedNode node = QuantisedNodes(wide_nodes_at(uvec2(structure))).node[part.index];
    parts[0] = part;
    parts[1] = part;
    if (node.exponents_and_nodes == LONG_LEAF) return false;
    uint slots = part.count & slots_in_use(node);
    if (bitCount(slots) < 2) return false;
    Cut cut = cut_slots(node, slots);
    parts[0] = part_of_node(node, cut.one, part.index, slots & ~cut.others);
    parts[1] = part_of_node(node, cut.other, part.index, cut.others);
    return true;
}

// The children of a node of two; of what cannot be opened twice itself, and false. `slots` are those of an Entry.
bool open_node_of_two(Structure structure, uint slots, Child child, out Child children[2]) {
    bool opens = child.count == 0u && child.index < (slots & INDEX_MASK);
    children[0] = child;
    children[1] = child;
    if (opens) {
        Node node = structure.nodes[child.index];
        children[0] = node.left;
        children[1] = node.right;
    }
    return opens;
}

// The two parts of a part, of either form.
bool open_child(Structure structure, uint slots, Child child, out Child children[2]) {
    if ((slots & FORM_QUANTISED) == 0u) return open_node_of_two(structure, slots, child, children);
    children[0] = child;
    children[1] = child;
    return child.index < (slots & INDEX_MASK) && open_quantised(structure, child, children);
}
#endif
