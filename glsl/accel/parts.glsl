// The parts of a structure below a top level, as a binary tree: what instances are opened to, and what their boxes are made of. The twin
// is `Below` in src/accel/twin/mod.rs.
//
// A part is a Child. Of quantised nodes it is some of a node's slots, and `count` says which, a bit each. A part of one slot that holds a node
// is that node, whole. Only whole nodes have a box of their own: others have those in their slots.
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

// How long the edges of a quantised node's cells are.
vec3 cell_of(QuantisedNode node) {
    uint e = node.exponents_and_nodes;
    return uintBitsToFloat((uvec3(e, e >> 8, e >> 16) & 0xFFu) << 23);
}

// Of each axis the byte of a slot.
vec3 bytes_of_slot(uvec2 bytes[3], uint slot) {
    return vec3(byte_of_slot(bytes[0], slot), byte_of_slot(bytes[1], slot), byte_of_slot(bytes[2], slot));
}

// The box in a slot of a quantised node.
Box box_in_slot(QuantisedNode node, uint slot) {
    vec3 cell = cell_of(node);
    precise vec3 least = uintBitsToFloat(node.origin) + bytes_of_slot(node.lo, slot) * cell;
    precise vec3 greatest = uintBitsToFloat(node.origin) + bytes_of_slot(node.hi, slot) * cell;
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

// Which of four bytes are not 0, a bit each.
uint bytes_in_use(uint bytes) {
    uint tops = ((bytes & 0x7F7F7F7Fu) + 0x7F7F7F7Fu | bytes) & 0x80808080u;
    // Bits 0, 8, 16, 24 to 28, 29, 30, 31.
    return (tops >> 7) * 0x10204080u >> 28;
}

// Which slots of a quantised node hold anything.
uint slots_in_use(QuantisedNode node) {
    return node.exponents_and_nodes >> 24 | bytes_in_use(node.counts.x) | bytes_in_use(node.counts.y) << 4;
}

// Some of the slots of the node at `index`.
Child part_of_node(QuantisedNode node, uint index, uint slots) {
    uint nodes = node.exponents_and_nodes >> 24;
    Child part = Child(vec3(0), index, vec3(0), slots);
    if (bitCount(slots) == 1 && (slots & nodes) != 0u) {
        uint slot = uint(findLSB(slots));
        Box b = box_in_slot(node, slot);
        part = Child(b.lo, node.first_child + rank_of_node(nodes, slot), b.hi, ALL_SLOTS);
    }
    return part;
}

// How large a box is in the world, whichever way its instance turns it: about the square of the sum of its edges. By its own area two long
// halves of a long box would be as good as two short ones.
float size_of(Box b) {
    precise vec3 e = b.hi - b.lo;
    precise float edges = e.x + e.y + e.z;
    precise float size = edges * edges;
    return size;
}

// Two or more slots cut in two: those of the other part. As Guttman (1984, section 3.5.2) splits a node of an R-tree: the two slots begin
// that together in one box would waste most, and each of the others goes to the part that grows less by it.
uint cut_slots(QuantisedNode node, uint slots) {
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
    Box one = boxes.of[0], other = boxes.of[0];
    [[unroll]] for (uint i = 1; i < 8; ++i) {
        if (first.x == i) one = boxes.of[i];
        if (first.y == i) other = boxes.of[i];
    }
    uint others = 1u << first.y;
    vec2 size = vec2(size_of(one), size_of(other));
#define JOIN(i)                                                                                 \
    {                                                                                           \
        Box with_one = united(one, boxes.of[i]), with_other = united(other, boxes.of[i]);       \
        vec2 joined = vec2(size_of(with_one), size_of(with_other));                             \
        precise vec2 sum = joined + size.yx;                                                    \
        bool joins = (slots >> i & 1u) != 0u && i != first.x && i != first.y;                   \
        bool joins_other = joins && sum.y < sum.x;                                              \
        bool joins_one = joins && !joins_other;                                                 \
        if (joins_one) one = with_one;                                                          \
        if (joins_other) other = with_other;                                                    \
        size = vec2(joins_one ? joined.x : size.x, joins_other ? joined.y : size.y);            \
        others |= joins_other ? 1u << i : 0u;                                                   \
    }
    JOIN(0) JOIN(1) JOIN(2) JOIN(3) JOIN(4) JOIN(5) JOIN(6) JOIN(7)
#undef JOIN
    return others;
}

// The node that a part is of, where it is one of eight and there: `near`, if that has its index. Of others no function asks for it.
// `slots` are those of an Entry.
QuantisedNode node_of(Structure structure, uint slots, Child part, uint near_index, QuantisedNode near) {
    QuantisedNode node = near;
    if ((slots & FORM_QUANTISED) != 0u && part.index < (slots & INDEX_MASK) && part.index != near_index) {
        node = QuantisedNodes(wide_nodes_at(uvec2(structure))).node[part.index];
    }
    return node;
}

QuantisedNode node_of(Structure structure, uint slots, Child part) {
    const uvec2 none[3] = uvec2[3](uvec2(0), uvec2(0), uvec2(0));
    return node_of(structure, slots, part, 0xFFFFFFFFu, QuantisedNode(uvec3(0), 0u, 0u, 0u, uvec2(0), none, none));
}

// Of a part of `node` the slots that hold anything; none where it is no node of eight.
uint slots_of_part(QuantisedNode node, uint slots, Child part) {
    bool has_slots = (slots & FORM_QUANTISED) != 0u && part.index < (slots & INDEX_MASK) && node.exponents_and_nodes != LONG_LEAF;
    return has_slots ? part.count & slots_in_use(node) : 0u;
}

// The slots of the second of a part's two parts; 0 if it has none, and of nodes of two.
uint cut_of(QuantisedNode node, uint slots, Child part) {
    uint in_use = slots_of_part(node, slots, part);
    // Of two it is the higher one, of fewer none.
    uint others = in_use & in_use - 1u;
    if (bitCount(in_use) > 2) others = cut_slots(node, in_use);
    return others;
}

bool is_node_of_two(uint slots, Child child) {
    return child.count == 0u && child.index < (slots & INDEX_MASK);
}

// The children of a node of two; of what is none twice itself.
void open_node_of_two(Structure structure, uint slots, Child child, out Child children[2]) {
    children[0] = child;
    children[1] = child;
    if (is_node_of_two(slots, child)) {
        Node node = structure.nodes[child.index];
        children[0] = node.left;
        children[1] = node.right;
    }
}

// Whether a part of either form can be opened, which cut_of() cuts by `cut`.
bool opens(uint slots, Child part, uint cut) {
    return (slots & FORM_QUANTISED) != 0u ? cut != 0u : is_node_of_two(slots, part);
}

// The two parts of one that can be opened.
void open_part(Structure structure, QuantisedNode node, uint slots, Child part, uint cut, out Child parts[2]) {
    if ((slots & FORM_QUANTISED) == 0u) {
        open_node_of_two(structure, slots, part, parts);
    } else {
        parts[0] = part_of_node(node, part.index, part.count & slots_in_use(node) & ~cut);
        parts[1] = part_of_node(node, part.index, cut);
    }
}
#endif
