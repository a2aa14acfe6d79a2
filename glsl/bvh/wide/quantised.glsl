// The node of eight children in 80 bytes: the twin of src/bvh/wide/quantised.rs, which describes it.
#ifndef HEDGEROW_BVH_WIDE_QUANTISED
#define HEDGEROW_BVH_WIDE_QUANTISED
#include "bvh/wide.glsl"

float cells_of(uint exponent) {
    return uintBitsToFloat(exponent << 23);
}

// The biased exponent of the smallest cells of which 255 reach from lo to hi.
uint cell_exponent(float lo, float hi) {
    precise float half_edge = 0.5 * hi - 0.5 * lo;
    uint exponent = uint(max(int(floatBitsToUint(half_edge) >> 23) - 6, 1));
    precise float reached = lo + 255.0 * cells_of(exponent);
    return reached >= hi ? exponent : exponent + 1;
}

float cells_from(float origin, float x, uint exponent) {
    precise float cells = (0.5 * x - 0.5 * origin) * uintBitsToFloat((255 - exponent) << 23);
    return cells;
}

// The greatest byte whose corner is not above x.
uint byte_below(float x, float origin, uint exponent) {
    float byte = clamp(floor(cells_from(origin, x, exponent)), 0.0, 255.0);
    precise float corner = origin + byte * cells_of(exponent);
    return uint(byte) - (corner > x && byte > 0.0 ? 1 : 0);
}

// The least byte whose corner is not below x.
uint byte_above(float x, float origin, uint exponent) {
    float byte = clamp(ceil(cells_from(origin, x, exponent)), 0.0, 255.0);
    precise float corner = origin + byte * cells_of(exponent);
    return uint(byte) + (corner < x && byte < 255.0 ? 1 : 0);
}

QuantisedNode empty_quantised_node() {
    uvec2 most = uvec2(0xFFFFFFFFu), none = uvec2(0);
    return QuantisedNode(uvec3(0), 0x00010101u, 0, 0, none, uvec2[3](most, most, most), uvec2[3](none, none, none));
}

QuantisedNode long_leaf_node(uint first, uint count) {
    uvec2 none = uvec2(0);
    return QuantisedNode(uvec3(0), LONG_LEAF, count, first, none, uvec2[3](none, none, none), uvec2[3](none, none, none));
}

// A node around lo..hi, without children.
QuantisedNode quantised_node_around(vec3 lo, vec3 hi, uint first_child, uint first_record) {
    QuantisedNode node = long_leaf_node(first_record, first_child);
    node.origin = floatBitsToUint(lo);
    node.exponents_and_nodes = cell_exponent(lo.x, hi.x) | cell_exponent(lo.y, hi.y) << 8 | cell_exponent(lo.z, hi.z) << 16;
    return node;
}

// Puts a child of this box into a slot; an empty slot has no records and no node.
void put_into_slot(inout QuantisedNode node, uint slot, bool is_there, vec3 lo, vec3 hi, bool is_node, uint records) {
    uint word = slot >> 2, shift = (slot & 3u) * 8;
    for (uint axis = 0; axis < 3; ++axis) {
        float origin = uintBitsToFloat(node.origin[axis]);
        uint exponent = node.exponents_and_nodes >> (8 * axis) & 0xFFu;
        uint below = is_there ? byte_below(lo[axis], origin, exponent) : 255;
        uint above = is_there ? byte_above(hi[axis], origin, exponent) : 0;
        node.lo[axis][word] |= below << shift;
        node.hi[axis][word] |= above << shift;
    }
    if (is_node) node.exponents_and_nodes |= 1u << (24 + slot);
    else node.counts[word] |= records << shift;
}
#endif
