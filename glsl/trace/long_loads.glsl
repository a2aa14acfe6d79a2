// Nodes and triangles in elements of 64 bits: where lanes gather (CPUs), a gather of them takes as long as one of 32 bits, and half as many
// are enough. Whoever includes this is a second module of its source.
//
// needs   the feature shaderInt64 (gpu::Optional::int64 in src/gpu/requirements.rs)
#ifndef HEDGEROW_TRACE_LONG_LOADS
#define HEDGEROW_TRACE_LONG_LOADS
#include "bvh/wide.glsl"
#include "bvh/wide/pairs.glsl"
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer HedgerowLongs { uint64_t element[]; };

uvec2 hedgerow_pair_of(HedgerowLongs at, uint index) {
    return unpackUint2x32(at.element[index]);
}

// Of two elements.
uvec4 hedgerow_quad_of(HedgerowLongs at, uint index) {
    return uvec4(hedgerow_pair_of(at, index), hedgerow_pair_of(at, index + 1u));
}

Node hedgerow_long_node(uvec2 address) {
    HedgerowLongs at = HedgerowLongs(address);
    uvec4 a = hedgerow_quad_of(at, 0u), b = hedgerow_quad_of(at, 2u), c = hedgerow_quad_of(at, 4u), d = hedgerow_quad_of(at, 6u);
    return Node(Child(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w),
                Child(uintBitsToFloat(c.xyz), c.w, uintBitsToFloat(d.xyz), d.w));
}

Triangle hedgerow_long_triangle(uvec2 address) {
    HedgerowLongs at = HedgerowLongs(address);
    uvec4 a = hedgerow_quad_of(at, 0u), b = hedgerow_quad_of(at, 2u);
    uvec2 c = hedgerow_pair_of(at, 4u);
    return Triangle(uintBitsToFloat(a.xyz), uintBitsToFloat(uvec3(a.w, b.xy)), uintBitsToFloat(uvec3(b.zw, c.x)), c.y);
}

SecondOfPair hedgerow_long_second_of_pair(uvec2 address) {
    uvec4 a = hedgerow_quad_of(HedgerowLongs(address), 0u);
    return SecondOfPair(uintBitsToFloat(a.xyz), a.w);
}

QuantisedNode hedgerow_long_quantised_node(uvec2 address) {
    HedgerowLongs at = HedgerowLongs(address);
    uvec4 a = hedgerow_quad_of(at, 0u), b = hedgerow_quad_of(at, 2u), c = hedgerow_quad_of(at, 4u), d = hedgerow_quad_of(at, 6u);
    uvec4 e = hedgerow_quad_of(at, 8u);
    return QuantisedNode(a.xyz, a.w, b.x, b.y, b.zw, uvec2[](c.xy, c.zw, d.xy), uvec2[](d.zw, e.xy, e.zw));
}
#endif
