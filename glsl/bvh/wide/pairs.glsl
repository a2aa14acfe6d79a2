// Records of quantised trees of triangles: one or two, which share an edge. The twin of src/bvh/wide/pairs.rs, which describes the bytes.
// Where a record is, is counted in units of 8 bytes.
#ifndef HEDGEROW_BVH_WIDE_PAIRS
#define HEDGEROW_BVH_WIDE_PAIRS
#include "bvh/layout.glsl"

const uint UNITS_OF_ONE = 5;
const uint UNITS_OF_TWO = 7;
const uint PRIMITIVE_BITS = 27;
const uint PRIMITIVE_MASK = (1u << PRIMITIVE_BITS) - 1u;
const uint HAS_SECOND = 1u << PRIMITIVE_BITS;

// What lies behind the first triangle of a pair.
struct SecondOfPair {
    vec3 vertex;
    uint primitive;
};

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer SecondsOfPairs { SecondOfPair second[]; };

// Records by the units that they begin at: a driver adds an index that is the same for all lanes to an address of 64 bits by one plain
// instruction, where adding by halves (record_at_unit) takes eight.
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly restrict buffer Units { uvec2 unit[]; };

Triangle triangle_in_units(Units units, uint at) {
    vec2 a = uintBitsToFloat(units.unit[at]), b = uintBitsToFloat(units.unit[at + 1u]), c = uintBitsToFloat(units.unit[at + 2u]);
    vec2 d = uintBitsToFloat(units.unit[at + 3u]);
    uvec2 e = units.unit[at + 4u];
    return Triangle(vec3(a, b.x), vec3(b.y, c), vec3(d, uintBitsToFloat(e.x)), e.y);
}

SecondOfPair second_in_units(Units units, uint at) {
    uvec2 a = units.unit[at], b = units.unit[at + 1u];
    return SecondOfPair(uintBitsToFloat(uvec3(a, b.x)), b.y);
}

// Where a record begins, and where what lies behind its first triangle does.
uvec2 record_at_unit(uvec2 records, uint unit) {
    return address_of(records, unit, 8u);
}

uvec2 second_at_unit(uvec2 records, uint unit) {
    return address_of(records, unit + UNITS_OF_ONE, 8u);
}

// `first` as it lies in memory.
bool has_second(Triangle first) {
    return (first.primitive & HAS_SECOND) != 0u;
}

uint units_of_record(Triangle first) {
    return has_second(first) ? UNITS_OF_TWO : UNITS_OF_ONE;
}

vec3 vertex_of_pair(Triangle first, SecondOfPair second, uint which) {
    vec3 v = (which & 1u) != 0u ? first.v1 : first.v0;
    vec3 w = (which & 1u) != 0u ? second.vertex : first.v2;
    return (which & 2u) != 0u ? w : v;
}

Triangle first_of_pair(Triangle first) {
    return Triangle(first.v0, first.v1, first.v2, first.primitive & PRIMITIVE_MASK);
}

Triangle second_of_pair(Triangle first, SecondOfPair second) {
    return Triangle(vertex_of_pair(first, second, first.primitive >> 28), vertex_of_pair(first, second, first.primitive >> 30),
                    vertex_of_pair(first, second, second.primitive >> PRIMITIVE_BITS), second.primitive & PRIMITIVE_MASK);
}
#endif
