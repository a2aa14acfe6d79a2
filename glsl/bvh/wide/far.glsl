// What is far from the rest of a top level: a part of the steps `open` and `nodes` of bvh/wide/collapse.glsl. src/bvh/wide/far.rs says what it is
// for, src/bvh/twin/wide/far.rs is the twin.
#ifndef HEDGEROW_BVH_WIDE_FAR
#define HEDGEROW_BVH_WIDE_FAR
#include "bvh/wide/collapse.glsl"

// src/bvh/wide/far.rs
const float FAR_BY = 0.5;

const uint ON_NO_SIDE = FAR_SIDES;

// The side of what is near to which another child lies by more than FAR_BY of its longest edges, the first one.
uint side_of(Child near, Child other) {
    float scale = source.header.area_scale;
    vec3 edges = scaled_edges(Box(near.lo, near.hi), scale);
    float least = max(FAR_BY * max(max(edges.x, edges.y), edges.z), SHORTEST);
    precise vec3 below = near.lo * scale - other.hi * scale;
    precise vec3 above = other.lo * scale - near.hi * scale;
    uint side = ON_NO_SIDE;
    for (uint axis = 3; axis-- > 0;) {
        side = above[axis] > least ? 2 * axis + 1 : side;
        side = below[axis] > least ? 2 * axis : side;
    }
    return side;
}

// What names the first child of a top level's root, if that is a node: what is near, where something is far. Otherwise NO_CHILD.
uint name_of_near() {
    Child root = source.header.root;
    if (!QUANTISED || source.header.kind != KIND_INSTANCES || !is_inner(root)) return NO_CHILD;
    uint name = 2 * root.index;
    return is_inner(child_named(name)) ? name : NO_CHILD;
}

FarBox far_box(Child near, uint first, uint side) {
    FarBox b = FarBox(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
    for (uint s = 0; s < 8; ++s) {
        uint name = slots.word[s];
        if (name == NO_CHILD || name == first) continue;
        Child other = child_named(name);
        if (side_of(near, other) == side) b = FarBox(min(b.lo, other.lo), max(b.hi, other.hi));
    }
    return b;
}

// Tells in the header, which is written, what is far of the root's children; the nodes among them begin with `next_node`.
void tell_far(uint next_node) {
    uint first = name_of_near();
    if (first == NO_CHILD) return;
    Child near = child_named(first);
    uint near_node = 0, others = 0;
    bool all_are_far = true;
    for (uint s = 0; s < 8; ++s) {
        uint name = slots.word[s];
        if (name == NO_CHILD) continue;
        Child child = child_named(name);
        if (name == first) near_node = next_node;
        else all_are_far = all_are_far && side_of(near, child) != ON_NO_SIDE;
        others += name == first ? 0 : 1;
        next_node += is_wide_node(child) ? 1 : 0;
    }
    if (near_node == 0 || others == 0 || !all_are_far) return;
    Header header = Structure(target).header;
    FarBoxes boxes = FarBoxes(far_boxes_of(target, header));
    uint sides = 0;
    for (uint side = 0; side < FAR_SIDES; ++side) {
        FarBox b = far_box(near, first, side);
        boxes.box[side] = b;
        sides |= b.lo.x <= b.hi.x ? 1u << side : 0u;
    }
    Structure(target).header.near_node = near_node;
    Structure(target).header.far_sides = sides;
}
#endif
