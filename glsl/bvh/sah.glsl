// Costs of the surface area heuristic: the twin of src/bvh/sah.rs, bit for bit.
#ifndef HEDGEROW_BVH_SAH
#define HEDGEROW_BVH_SAH
#include "bvh/geometry.glsl"

// Shorter edges count as none, the scene's longest being 1 to 4: of what is computed from them some devices would take a part for
// zero, and costs would be compared otherwise.
const float SHORTEST = 8.881784197001252e-16;   // 2^-50

vec3 scaled_edges(Box b, float scale) {
    precise vec3 e = b.hi * scale - b.lo * scale;
    return mix(vec3(0.0), e, greaterThanEqual(abs(e), vec3(SHORTEST)));
}

float half_area_of_edges(vec3 e) {
    precise float area = e.x * e.y + e.y * e.z + e.z * e.x;
    return area;
}

float scaled_half_area(Box b, float scale) {
    return half_area_of_edges(scaled_edges(b, scale));
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
