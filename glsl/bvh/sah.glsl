// Costs of the surface area heuristic: the twin of src/bvh/sah.rs, bit for bit.
#ifndef HEDGEROW_BVH_SAH
#define HEDGEROW_BVH_SAH
#include "bvh/geometry.glsl"

float scaled_half_area(Box b, float scale) {
    precise vec3 e = b.hi * scale - b.lo * scale;
    precise float area = e.x * e.y + e.y * e.z + e.z * e.x;
    return area;
}

// Of `count` primitives with this area, a test of one costing c_i.
float leaf_cost(float c_i, float area, uint count) {
    precise float cost = c_i * area * float(count);
    return cost;
}

// Of a node with this area over children of these costs, a step costing c_t.
float inner_cost(float c_t, float area, float left, float right) {
    precise float cost = c_t * area + (left + right);
    return cost;
}
#endif
