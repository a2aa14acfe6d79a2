// What a plane costs: src/kdtree/host/heuristic.rs is the twin, bit for bit.
#ifndef HEDGEROW_KDTREE_HEURISTIC
#define HEDGEROW_KDTREE_HEURISTIC
#include "kdtree/builder.glsl"

const uint INFINITE = 0x7F800000u;

// A plane as workgroups compare it: the cheapest, of equal ones that of the first axis, and there the leftmost.
struct KdPlane {
    uint cost;      // the bits of a float that is not negative
    uint axis;
    uint place;     // `ordered` position
    bool planar_left;
};

KdPlane no_plane() {
    return KdPlane(INFINITE, NONE, NONE, false);
}

void half_cells(Box cell, uint axis, float at, out Box left, out Box right) {
    left = cell;
    right = cell;
    left.hi[axis] = at;
    right.lo[axis] = at;
}

// The cost of a plane with these numbers of references on the left, in it, and on the right. What lies in it is on the left, or where it
// costs less. INFINITE at and beyond the faces.
uint plane_cost(Box cell, float area_scale, uint axis, float at, uvec3 counts, bool is_planar_left, out bool planar_left) {
    planar_left = true;
    if (!(at > cell.lo[axis] && at < cell.hi[axis])) return INFINITE;
    Box left, right;
    half_cells(cell, axis, at, left, right);
    float left_area = scaled_half_area(left, area_scale), right_area = scaled_half_area(right, area_scale);
    planar_left = is_planar_left || left_area <= right_area;
    uvec2 sides = planar_left ? uvec2(counts.x + counts.y, counts.z) : uvec2(counts.x, counts.y + counts.z);
    precise float tests = left_area * float(sides.x) + right_area * float(sides.y);
    precise float steps = c_t * scaled_half_area(cell, area_scale);
    precise float cost = steps + c_i * tests;
    return floatBitsToUint(cost);
}

// Whether a leaf of this many references costs more.
bool pays(uint cost, Box cell, float area_scale, uint count) {
    precise float leaf = c_i * (scaled_half_area(cell, area_scale) * float(count));
    return cost < floatBitsToUint(leaf);
}

float positive_zero(float x) {
    return x == 0.0 ? 0.0 : x;
}

uint ordered_float(float x) {
    uint bits = floatBitsToUint(x);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

float float_of_ordered(uint o) {
    return uintBitsToFloat((o & 0x80000000u) != 0u ? o & 0x7FFFFFFFu : ~o);
}

bool is_better(KdPlane a, KdPlane b) {
    return a.cost < b.cost || a.cost == b.cost && (a.axis < b.axis || a.axis == b.axis && a.place < b.place);
}

// Of the best planes of all lanes the best.
KdPlane best_of_all(KdPlane own) {
    KdPlane best;
    best.cost = subgroupMin(own.cost);
    bool is_candidate = own.cost == best.cost;
    best.axis = subgroupMin(is_candidate ? own.axis : NONE);
    is_candidate = is_candidate && own.axis == best.axis;
    best.place = subgroupMin(is_candidate ? own.place : NONE);
    // Where planes are one, so are their sides.
    best.planar_left = subgroupMin(is_candidate && own.place == best.place ? (own.planar_left ? 1u : 0u) : NONE) == 1u;
    if (gl_NumSubgroups > 1u) {
        exchange(uvec4(best.cost, best.axis, best.place, best.planar_left ? 1u : 0u));
        for (uint s = 0; s < gl_NumSubgroups; ++s) {
            KdPlane other = KdPlane(partial[s].x, partial[s].y, partial[s].z, partial[s].w == 1u);
            if (is_better(other, best)) best = other;
        }
    }
    return best;
}
#endif
