// The box in the world of an instance, or of a part of one: the twin of src/accel/world_box.rs.
#ifndef HEDGEROW_ACCEL_WORLD_BOX
#define HEDGEROW_ACCEL_WORLD_BOX
#include "bvh/instances.glsl"

// Levels below a child whose boxes are transformed in its place, where its own would be loose: eight boxes.
const uint FINE_LEVELS = 3;

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

// The box in the world of what is below `child` of a structure.
Box world_box(vec4 m[3], Structure structure, Child child) {
    if (keeps_boxes(m)) return transformed_box(m, child.lo, child.hi);
    Box b = Box(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
    uint slots = structure.header.node_slots;
    for (uint path = 0; path < 1u << FINE_LEVELS; ++path) {
        Child at = child;
        for (uint level = 0; level < FINE_LEVELS && at.count == 0u && at.index < slots; ++level) {
            Node node = structure.nodes[at.index];
            if ((path >> level & 1u) == 0u) at = node.left;
            else at = node.right;
        }
        Box part = transformed_box(m, at.lo, at.hi);
        b = Box(min(b.lo, part.lo), max(b.hi, part.hi));
    }
    return b;
}
#endif
