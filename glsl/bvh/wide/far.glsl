// What is far from the rest of a top level in nodes of eight: a part of the steps `open` and `nodes` of bvh/wide/collapse.glsl.
// src/bvh/far.rs says what it is for, src/bvh/twin/far.rs is the twin.
#ifndef HEDGEROW_BVH_WIDE_FAR
#define HEDGEROW_BVH_WIDE_FAR
#include "bvh/wide/collapse.glsl"
#include "bvh/far.glsl"

// What names the first child of a top level's root, if that is a node: what is near, where something is far. Otherwise NO_CHILD.
uint name_of_near() {
    Child root = source.header.root;
    if (!QUANTISED || source.header.kind != KIND_INSTANCES || !is_inner(root)) return NO_CHILD;
    uint name = 2 * root.index;
    return is_inner(child_named(name)) ? name : NO_CHILD;
}

// Tells in the header, which is written, what is far of the root's children, and writes the boxes of it; the nodes among them begin with
// `next_node`. Where not all is far but the near one, what was written lies behind what is in use.
void tell_far(uint next_node) {
    uint first = name_of_near();
    if (first == NO_CHILD) return;
    Child near = child_named(first);
    FarBoxes boxes = FarBoxes(far_boxes_of(target, Structure(target).header));
    for (uint side = 0; side < FAR_SIDES; ++side) boxes.box[side] = far_box_of_nothing();
    uint near_node = 0, sides = 0;
    NextSlots of_root = slots_of(0);
    for (uint s = 0; s < 8; ++s) {
        uint in_slot = take_slot(of_root);
        if (in_slot == NO_CHILD) continue;
        Child child = child_in(in_slot);
        if (in_slot == first) {
            near_node = next_node;
        } else {
            uint side = side_of(near, child, source.header.area_scale);
            if (side == ON_NO_SIDE) return;
            FarBox b = boxes.box[side];
            boxes.box[side] = FarBox(min(b.lo, child.lo), max(b.hi, child.hi));
            sides |= 1u << side;
        }
        next_node += is_node_in(in_slot) ? 1 : 0;
    }
    if (near_node == 0 || sides == 0) return;
    Structure(target).header.near_node = near_node;
    Structure(target).header.far_sides = sides;
}
#endif
