// The caller's triangles: three vertex indices each, and positions with a stride. What is not finite or out of range is
// left out, and never read outside the buffers.
#ifndef HEDGEROW_BVH_TRIANGLES
#define HEDGEROW_BVH_TRIANGLES
#include "gpu/pass.glsl"
#include "bvh/layout.glsl"

struct Input {
    Floats positions;
    Words indices;
    uint primitive_count;
    uint vertex_count;
    uint vertex_stride;   // floats from one vertex to the next
};

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

vec3 vertex_at(Input mesh, uint index) {
    uint at = index * mesh.vertex_stride;
    return vec3(mesh.positions.value[at], mesh.positions.value[at + 1], mesh.positions.value[at + 2]);
}

// The corners of a primitive; returns 0, or the status bit that tells why it is left out (then the corners are zero).
uint load_corners(Input mesh, uint primitive, out Corners c) {
    uvec3 v = uvec3(mesh.indices.word[3 * primitive], mesh.indices.word[3 * primitive + 1], mesh.indices.word[3 * primitive + 2]);
    c = Corners(vec3(0), vec3(0), vec3(0));
    if (max(v.x, max(v.y, v.z)) >= mesh.vertex_count) return STATUS_INDEX_OUT_OF_RANGE;
    vec3 v0 = vertex_at(mesh, v.x), v1 = vertex_at(mesh, v.y), v2 = vertex_at(mesh, v.z);
    if (!is_finite(v0) || !is_finite(v1) || !is_finite(v2)) return STATUS_NON_FINITE;
    c = Corners(without_negative_zero(v0), without_negative_zero(v1), without_negative_zero(v2));
    return 0;
}

Box box_around(Corners c) {
    return Box(min(c.v0, min(c.v1, c.v2)), max(c.v0, max(c.v1, c.v2)));
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
