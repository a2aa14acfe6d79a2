// What lies far from the rest of a top level: src/bvh/far.rs.
#ifndef HEDGEROW_BVH_FAR
#define HEDGEROW_BVH_FAR
#include "bvh/layout.glsl"
#include "bvh/sah.glsl"

// src/bvh/far.rs
const float FAR_BY = 0.5;

const uint ON_NO_SIDE = FAR_SIDES;

FarBox far_box_of_nothing() {
    return FarBox(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
}

// The side of what is near to which another child lies by more than FAR_BY of its longest edges, the first one. Lengths are scaled as those of
// areas are.
uint side_of(Child near, Child other, float scale) {
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
#endif
