// The node of eight children in 80 bytes: the twin of src/bvh/wide/quantised.rs, which describes it.
#ifndef HEDGEROW_BVH_WIDE_QUANTISED
#define HEDGEROW_BVH_WIDE_QUANTISED
#include "bvh/wide.glsl"
#include "gpu/whole.glsl"

vec3 cells_of(uvec3 exponents) {
    return uintBitsToFloat(exponents << 23);
}

// The biased exponents of the smallest cells of which 255 reach from lo to hi.
uvec3 cell_exponents(vec3 lo, vec3 hi) {
    precise vec3 half_edges = 0.5 * hi - 0.5 * lo;
    uvec3 exponents = uvec3(max(ivec3(floatBitsToUint(half_edges) >> 23) - 6, ivec3(1)));
    precise vec3 reached = lo + 255.0 * cells_of(exponents);
    return exponents + uvec3(lessThan(reached, hi));
}

vec3 cells_from(vec3 origin, vec3 x, uvec3 exponents) {
    precise vec3 cells = (0.5 * x - 0.5 * origin) * uintBitsToFloat((255 - exponents) << 23);
    return cells;
}

// The greatest bytes whose corner is not above x.
uvec3 bytes_below(vec3 x, vec3 origin, uvec3 exponents) {
    vec3 bytes = clamp(floor(cells_from(origin, x, exponents)), 0.0, 255.0);
    precise vec3 corner = origin + bytes * cells_of(exponents);
    return whole(bytes) - uvec3(greaterThan(corner, x)) * uvec3(greaterThan(bytes, vec3(0.0)));
}

// The least bytes whose corner is not below x.
uvec3 bytes_above(vec3 x, vec3 origin, uvec3 exponents) {
    vec3 bytes = clamp(ceil(cells_from(origin, x, exponents)), 0.0, 255.0);
    precise vec3 corner = origin + bytes * cells_of(exponents);
    return whole(bytes) + uvec3(lessThan(corner, x)) * uvec3(lessThan(bytes, vec3(255.0)));
}

QuantisedNode empty_quantised_node() {
    uvec2 most = uvec2(0xFFFFFFFFu), none = uvec2(0);
    return QuantisedNode(uvec3(0), 0x00010101u, 0, 0, none, uvec2[3](most, most, most), uvec2[3](none, none, none));
}

QuantisedNode long_leaf_node(uint first, uint count) {
    uvec2 none = uvec2(0);
    return QuantisedNode(uvec3(0), LONG_LEAF, count, first, none, uvec2[3](none, none, none), uvec2[3](none, none, none));
}

// What a node holds of its children, from slot 0 on: as many bytes of each as there were children so far, the last one on top.
struct SlotBytes {
    uvec3 lo[2];
    uvec3 hi[2];
    uvec2 counts;
    uint nodes;
};

const SlotBytes NO_SLOT_BYTES = SlotBytes(uvec3[2](uvec3(0), uvec3(0)), uvec3[2](uvec3(0), uvec3(0)), uvec2(0), 0);

// The next slot's child, of this box in cells; an empty slot is inside out, has no records and is no node.
void put_into_next_slot(inout SlotBytes slots, uvec3 below, uvec3 above, bool is_node, uint records) {
    slots.lo[0] = slots.lo[0] >> 8 | slots.lo[1] << 24;
    slots.lo[1] = slots.lo[1] >> 8 | below << 24;
    slots.hi[0] = slots.hi[0] >> 8 | slots.hi[1] << 24;
    slots.hi[1] = slots.hi[1] >> 8 | above << 24;
    slots.counts = uvec2(slots.counts.x >> 8 | slots.counts.y << 24, slots.counts.y >> 8 | (is_node ? 0 : records) << 24);
    slots.nodes = slots.nodes >> 1 | (is_node ? 1u << 31 : 0u);
}

// The node whose eight slots are these, with cells of these sizes from `origin` on.
QuantisedNode quantised_node_of(SlotBytes slots, vec3 origin, uvec3 exponents, uint first_child, uint first_record) {
    uvec3 lo = slots.lo[0], lo_behind = slots.lo[1], hi = slots.hi[0], hi_behind = slots.hi[1];
    return QuantisedNode(floatBitsToUint(origin), exponents.x | exponents.y << 8 | exponents.z << 16 | slots.nodes, first_child, first_record,
                         slots.counts, uvec2[3](uvec2(lo.x, lo_behind.x), uvec2(lo.y, lo_behind.y), uvec2(lo.z, lo_behind.z)),
                         uvec2[3](uvec2(hi.x, hi_behind.x), uvec2(hi.y, hi_behind.y), uvec2(hi.z, hi_behind.z)));
}
#endif
