// The caller's triangles and boxes, in the formats of src/bvh/geometry.rs. What is not finite or out of range is left out, and
// never read outside the buffers (but for the rest of an aligned word).
#ifndef HEDGEROW_BVH_GEOMETRY
#define HEDGEROW_BVH_GEOMETRY
#include "gpu/pass.glsl"
#include "bvh/layout.glsl"

// Triangles: one geometry of three floats a vertex and 32-bit indices without a transform; one of any formats; several of any
// formats. Boxes: one geometry; several. The entries of a top level.
const uint SOURCE_MESH = 0;
const uint SOURCE_GEOMETRY = 1;
const uint SOURCE_GEOMETRIES = 2;
const uint SOURCE_BOXES = 3;
const uint SOURCE_SEVERAL_BOXES = 4;
const uint SOURCE_ENTRIES = 5;
layout(constant_id = 5) const uint SOURCE_WORD = 0;
const uint SOURCE = SOURCE_WORD & 7u;
// Whether leaves hold references (bvh/references.glsl) to the primitives.
const bool HAS_REFERENCES = (SOURCE_WORD & 8u) != 0u;
// Whether the structure has the primitives' numbers in place of their records, which are written when the tree is done.
const bool HAS_NUMBERS = (SOURCE_WORD & 16u) != 0u;
// Whether two triangles that share an edge may be one leaf from the start: bvh/pairs.glsl.
const bool HAS_PAIRS = (SOURCE_WORD & 64u) != 0u;
// Whether clusters (bvh/clusters.glsl) lie where records will.
const bool CLUSTERS_IN_RECORDS = (SOURCE_WORD & 32u) != 0u;

// A primitive is left out without a status bit: the caller wants it so.
const uint INACTIVE = 1u << 31;

const uint COMPONENT_FLOAT = 0;
const uint COMPONENT_HALF = 1;
const uint COMPONENT_SNORM = 2;

struct Geometry {
    uvec2 vertices;
    uvec2 indices;
    uvec2 transform;      // 0: none
    uint vertex_stride;   // bytes
    uint vertex_count;
    uint formats;         // kind of component, components << 8, bytes of an index << 16, flags << 24
    uint first;
};

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Geometries { Geometry geometry[]; };

// In the flags: the record that ends the others, where fewer primitives are there than were planned for.
const uint GEOMETRY_END = 1u << 7;

uint flags_of(Geometry g) {
    return g.formats >> 24;
}

struct Corners {
    vec3 v0;
    vec3 v1;
    vec3 v2;
};

struct Box {
    vec3 lo;
    vec3 hi;
};

// Whether no component is NaN or infinite: by the bits, which no optimiser argues with.
bool is_finite(vec3 v) {
    return all(notEqual(floatBitsToUint(v) & 0x7F800000u, uvec3(0x7F800000u)));
}

// Negative zeros become zeros, so that the least of two zeros is the same on every device.
vec3 without_negative_zero(vec3 v) {
    return uintBitsToFloat(mix(floatBitsToUint(v), uvec3(0), equal(floatBitsToUint(v), uvec3(0x80000000u))));
}

// The low bits of what lies at an address: the word around it, shifted.
uint bits_at(uvec2 address) {
    return Words(uvec2(address.x & ~3u, address.y)).word[0] >> 8u * (address.x & 3u);
}

float from_half(uint bits) {
    uint exponent = bits >> 10 & 31u, mantissa = bits & 1023u;
    // Exact, and normal however small.
    precise float subnormal = float(mantissa) * uintBitsToFloat((127u - 24u) << 23);
    uint magnitude = exponent == 0u ? floatBitsToUint(subnormal)
                                    : exponent == 31u ? 0x7F800000u | mantissa << 13 : exponent + 112u << 23 | mantissa << 13;
    return uintBitsToFloat((bits & 0x8000u) << 16 | magnitude);
}

float from_snorm(uint bits) {
    precise float x = float(bitfieldExtract(int(bits), 0, 16)) * (1.0 / 32767.0);
    return max(x, -1.0);
}

vec3 any_vertex_at(Geometry g, uint index) {
    uint kind = g.formats & 0xFFu, components = g.formats >> 8 & 0xFFu;
    uvec2 at = address_of(g.vertices, index, g.vertex_stride);
    vec3 v = vec3(0);
    for (uint k = 0; k < 3; ++k) {
        if (k < components) {
            uint bits = bits_at(address_of(at, k, kind == COMPONENT_FLOAT ? 4u : 2u));
            v[k] = kind == COMPONENT_FLOAT ? uintBitsToFloat(bits) : kind == COMPONENT_HALF ? from_half(bits & 0xFFFFu) : from_snorm(bits);
        }
    }
    if (all(equal(g.transform, uvec2(0)))) return v;
    Floats m = Floats(g.transform);
    precise vec3 moved;
    for (uint row = 0; row < 3; ++row) {
        moved[row] = m.value[4 * row] * v.x + m.value[4 * row + 1] * v.y + m.value[4 * row + 2] * v.z + m.value[4 * row + 3];
    }
    return moved;
}

vec3 vertex_at(Geometry g, uint index) {
    if (SOURCE != SOURCE_MESH) return any_vertex_at(g, index);
    // By address: vertices of more than 8 GiB have numbers of floats that no index has.
    Floats position = Floats(address_of(g.vertices, index, g.vertex_stride));
    return vec3(position.value[0], position.value[1], position.value[2]);
}

// The last geometry that begins at the primitive or before; `g` names the records and, in `vertex_count`, how many they are.
Geometry geometry_of(Geometry g, uint primitive) {
    Geometries records = Geometries(g.vertices);
    uint at = 0, end = g.vertex_count;
    for (uint halving = 0; halving < 32 && at + 1 < end; ++halving) {
        uint middle = at + (end - at) / 2;
        if (records.geometry[middle].first <= primitive) at = middle;
        else end = middle;
    }
    return records.geometry[at];
}

uvec3 indices_of(Geometry g, uint triangle) {
    if (SOURCE == SOURCE_MESH) {
        Words indices = Words(g.indices);
        return uvec3(indices.word[3 * triangle], indices.word[3 * triangle + 1], indices.word[3 * triangle + 2]);
    }
    uint bytes = g.formats >> 16 & 0xFFu;
    uvec3 v = 3 * triangle + uvec3(0, 1, 2);
    if (bytes == 0u) return v;
    uint mask = bytes == 4u ? 0xFFFFFFFFu : (1u << 8u * bytes) - 1u;
    for (uint k = 0; k < 3; ++k) v[k] = bits_at(address_of(g.indices, v[k], bytes)) & mask;
    return v;
}

// The corners of a triangle; returns 0, or the status bit for the reason that it is left out (then the corners are zero).
uint load_corners(Geometry g, uint primitive, out Corners c) {
    if (SOURCE == SOURCE_GEOMETRIES) g = geometry_of(g, primitive);
    c = Corners(vec3(0), vec3(0), vec3(0));
    if (SOURCE == SOURCE_GEOMETRIES && (flags_of(g) & GEOMETRY_END) != 0u) return INACTIVE;
    uvec3 v = indices_of(g, primitive - g.first);
    if (max(v.x, max(v.y, v.z)) >= g.vertex_count) return STATUS_INDEX_OUT_OF_RANGE;
    vec3 v0 = vertex_at(g, v.x), v1 = vertex_at(g, v.y), v2 = vertex_at(g, v.z);
    if (!is_finite(v0) || !is_finite(v1) || !is_finite(v2)) return STATUS_NON_FINITE;
    c = Corners(without_negative_zero(v0), without_negative_zero(v1), without_negative_zero(v2));
    return 0;
}

Box box_around(Corners c) {
    return Box(min(c.v0, min(c.v1, c.v2)), max(c.v0, max(c.v1, c.v2)));
}

// A box of the caller's, as VkAabbPositionsKHR has it; returns as load_corners does. One that is inside out holds nothing.
uint load_given_box(Geometry g, uint primitive, out Box b) {
    if (SOURCE == SOURCE_SEVERAL_BOXES) g = geometry_of(g, primitive);
    b = Box(vec3(0), vec3(0));
    if (SOURCE == SOURCE_SEVERAL_BOXES && (flags_of(g) & GEOMETRY_END) != 0u) return INACTIVE;
    Floats given = Floats(address_of(g.vertices, primitive - g.first, g.vertex_stride));
    vec3 lo = vec3(given.value[0], given.value[1], given.value[2]), hi = vec3(given.value[3], given.value[4], given.value[5]);
    if (!is_finite(lo) || !is_finite(hi) || any(greaterThan(lo, hi))) return STATUS_NON_FINITE;
    b = Box(without_negative_zero(lo), without_negative_zero(hi));
    return 0;
}

// Each half first: no overflow, and the same rounding everywhere.
vec3 centroid_of(Box b) {
    precise vec3 middle = 0.5 * b.lo + 0.5 * b.hi;
    return middle;
}

// Floats as integers of the same order, for atomics; and back.
uvec3 ordered(vec3 v) {
    uvec3 bits = floatBitsToUint(v);
    return mix(bits | 0x80000000u, ~bits, notEqual(bits & 0x80000000u, uvec3(0)));
}

vec3 from_ordered(uvec3 o) {
    return uintBitsToFloat(mix(~o, o & 0x7FFFFFFFu, notEqual(o & 0x80000000u, uvec3(0))));
}
#endif
