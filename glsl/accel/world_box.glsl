// The box in the world of an instance, or of a part of one: the twin of src/accel/twin/mod.rs.
#ifndef HEDGEROW_ACCEL_WORLD_BOX
#define HEDGEROW_ACCEL_WORLD_BOX
#include "accel/parts.glsl"

// The box around a transformed box, not smaller by any rounding.
Box transformed_box(vec4 m[3], vec3 lo, vec3 hi) {
    const float SLACK = uintBitsToFloat((127u - 21u) << 23);
    Box b;
    for (uint row = 0; row < 3; ++row) {
        precise vec3 p = m[row].xyz * lo;
        precise vec3 q = m[row].xyz * hi;
        vec3 least = min(p, q), most = max(p, q), size = max(abs(p), abs(q));
        precise float slack = SLACK * (((size.x + size.y) + size.z) + abs(m[row].w));
        precise float from = (((least.x + least.y) + least.z) + m[row].w) - slack;
        precise float to = (((most.x + most.y) + most.z) + m[row].w) + slack;
        b.lo[row] = from;
        b.hi[row] = to;
    }
    return b;
}

// Whether every axis of the object stays parallel to one of the world's: then a box's image is a box.
bool keeps_boxes(vec4 m[3]) {
    bool keeps = true;
    for (uint row = 0; row < 3; ++row) {
        keeps = keeps && dot(vec3(notEqual(m[row].xyz, vec3(0.0))), vec3(1.0)) <= 1.0;
    }
    return keeps;
}

// The box in the world around what is in the slots of a part of a node.
Box box_of_slots(vec4 m[3], QuantisedNode node, uint slots, Child part) {
    uint in_use = slots_of_part(node, slots, part);
    Box b = empty_box();
    for (uint left = in_use; left != 0u; left &= left - 1u) {
        Box in_slot = box_in_slot(node, uint(findLSB(left)));
        b = united(b, transformed_box(m, in_slot.lo, in_slot.hi));
    }
    if (in_use == 0u) b = transformed_box(m, part.lo, part.hi);
    return b;
}

// The box in the world around the boxes of a child's two children, of nodes of two.
Box box_of_two(vec4 m[3], Structure structure, uint slots, Child child) {
    Child pair[2];
    open_node_of_two(structure, slots, child, pair);
    return united(transformed_box(m, pair[0].lo, pair[0].hi), transformed_box(m, pair[1].lo, pair[1].hi));
}

// The same of nodes of either form: those of eight have slots.
Box box_of_children(vec4 m[3], Structure structure, QuantisedNode node, uint slots, Child child) {
    if ((slots & FORM_QUANTISED) != 0u) return box_of_slots(m, node, slots, child);
    return box_of_two(m, structure, slots, child);
}

// The box in the world of what is below `child` of a structure: where its own would be loose, around the boxes of the eight
// that are three levels below, or of its slots.
Box world_box(vec4 m[3], Structure structure, QuantisedNode node, uint slots, Child child) {
    if (keeps_boxes(m)) {
        Box own = Box(child.lo, child.hi);
        if ((slots & FORM_QUANTISED) != 0u) own = box_around(node, child);
        return transformed_box(m, own.lo, own.hi);
    }
    if ((slots & FORM_QUANTISED) != 0u) return box_of_slots(m, node, slots, child);
    Box b = empty_box();
    Child children[2];
    open_node_of_two(structure, slots, child, children);
    for (uint side = 0; side < 2; ++side) {
        Child grandchildren[2];
        open_node_of_two(structure, slots, children[side], grandchildren);
        for (uint quarter = 0; quarter < 2; ++quarter) {
            b = united(b, box_of_two(m, structure, slots, grandchildren[quarter]));
        }
    }
    return b;
}
#endif
