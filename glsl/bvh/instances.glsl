// What a top level is built of: the caller's instances, 64 bytes each as VkAccelerationStructureInstanceKHR has them, and the
// entries that glsl/accel/ makes of them: boxes in the world, each over an instance or a part of it. src/accel/instances.rs is
// the host's side.
#ifndef HEDGEROW_BVH_INSTANCES
#define HEDGEROW_BVH_INSTANCES
#include "gpu/division.glsl"
#include "gpu/reciprocal.glsl"
#include "bvh/geometry.glsl"

struct GivenInstance {
    vec4 to_world[3];         // object to world, row by row
    uint index_and_mask;
    uint offset_and_flags;
    uvec2 structure;          // 0: inactive
};

struct Entry {
    vec3 lo;
    uint instance;
    vec3 hi;
    uint start;               // in the instance's structure, with `slots` and `records` as in an Instance
    uint slots;
    uint records;
    uvec2 given;              // address of the GivenInstance
    uint left_out;            // 0, or why it is
    uint cut;                 // what re-braiding cuts off of it, once it is weighed (accel/parts.glsl, cut_of())
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer GivenInstances { GivenInstance instance[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Entries { Entry entry[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Pointers { uvec2 pointer[]; };

GivenInstance instance_of(Entry entry) {
    return GivenInstances(entry.given).instance[0];
}

// One that is left out, and why.
Entry entry_left_out(uint instance, uvec2 given, uint why) {
    return Entry(vec3(0), instance, vec3(0), 0u, 0u, 0u, given, why, 0u);
}

// Over a child in a structure of which so many records may be looked at, or over slots of a quantised node, which are the child's
// `count` then. What something else wrote there names no more of them.
Entry entry_over(Box b, uint instance, Child child, uint slots, uint records, uvec2 given) {
    uint index = min(child.index, INDEX_MASK);
    if ((slots & FORM_QUANTISED) != 0u) {
        uint above = child.count >> 32u - INDEX_BITS << INDEX_BITS;
        uint last = records & INDEX_MASK | above;
        return Entry(b.lo, instance, b.hi, index | child.count << INDEX_BITS, slots, last, given, 0u, 0u);
    }
    uint start = index | min(child.count, UP_TO_LAST) << INDEX_BITS;
    uint last = child.count >= UP_TO_LAST ? min(index + min(child.count, INDEX_MASK), records) : records;
    return Entry(b.lo, instance, b.hi, start, slots, last, given, 0u, 0u);
}

// 2^-k, where 2^k is about the greatest of a matrix: what it is scaled by so that its determinant neither overflows nor vanishes.
float scale_of_matrix(vec4 m[3]) {
    vec3 greatest = max(max(abs(m[0].xyz), abs(m[1].xyz)), abs(m[2].xyz));
    uint exponent = floatBitsToUint(max(max(greatest.x, greatest.y), greatest.z)) >> 23 & 0xFFu;
    return uintBitsToFloat(clamp(254u - exponent, 1u, 254u) << 23);
}

// a × b.
vec3 cross_product(vec3 a, vec3 b) {
    precise vec3 c = a.yzx * b.zxy - a.zxy * b.yzx;
    return c;
}

// The inverse of an affine matrix, by its adjugate; false if it is not finite.
bool inverse_of(vec4 m[3], out vec4 inverse[3]) {
    float scale = scale_of_matrix(m);
    vec3 a = m[0].xyz * scale, b = m[1].xyz * scale, c = m[2].xyz * scale;
    vec3 columns[3] = vec3[3](cross_product(b, c), cross_product(c, a), cross_product(a, b));
    precise float determinant = a.x * columns[0].x + a.y * columns[0].y + a.z * columns[0].z;
    precise float reciprocal = scale * hedgerow_reciprocal(determinant);
    vec3 moved = vec3(m[0].w, m[1].w, m[2].w);
    bool finite = is_finite(moved);
    for (uint row = 0; row < 3; ++row) {
        precise vec3 r = vec3(columns[0][row], columns[1][row], columns[2][row]) * reciprocal;
        precise float w = -(r.x * moved.x + r.y * moved.y + r.z * moved.z);
        inverse[row] = vec4(r, w);
        finite = finite && is_finite(r) && is_finite(vec3(w));
    }
    return finite && abs(determinant) > 0.0;
}

// The record of an entry that is part of the tree; all zero for one that is not.
Instance record_of(Entry entry) {
    vec4 none[3] = vec4[3](vec4(0), vec4(0), vec4(0));
    if (entry.left_out != 0u) return Instance(none, none, uvec2(0), 0, 0, entry.instance, 0, 0, 0);
    GivenInstance given = instance_of(entry);
    vec4 to_object[3];
    inverse_of(given.to_world, to_object);
    return Instance(to_object, given.to_world, given.structure, given.index_and_mask, given.offset_and_flags, entry.instance,
                    entry.start, entry.slots, entry.records);
}
#endif
