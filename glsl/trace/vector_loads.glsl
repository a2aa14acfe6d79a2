// Nodes and triangles as tracers load them: member by member, in vectors, or with HEDGEROW_INT64 in elements of 64 bits. A GPU takes a node
// of 64 bytes by four loads of 128 bits, and a triangle by five of 64, where members one by one are sixteen and ten; and memory that nothing
// writes while rays are traced may lie in its read-only cache. Where lanes gather (CPUs), a vector is as many gathers as it has words, and
// an element of 64 bits is one.
#ifndef HEDGEROW_TRACE_VECTOR_LOADS
#define HEDGEROW_TRACE_VECTOR_LOADS
#include "bvh/layout.glsl"
#include "bvh/wide/pairs.glsl"
#ifdef HEDGEROW_INT64
#include "trace/long_loads.glsl"
#endif

// 4 is LANES of the kernels that load lane by lane.
layout(constant_id = 5) const bool IN_VECTORS = false;

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly restrict buffer Quads { uvec4 quad[]; };

Child child_of_quads(uvec4 lo, uvec4 hi) {
    return Child(uintBitsToFloat(lo.xyz), lo.w, uintBitsToFloat(hi.xyz), hi.w);
}

// Nodes are fewer than 2^27: no product here is over 2^32.
Node node_at(Structure structure, uint index) {
#ifdef HEDGEROW_INT64
    return hedgerow_long_node(address_of(uvec2(structure), 2u + index, 64u));
#else
    if (!IN_VECTORS) return structure.nodes[index];
    // Behind the header's 128 bytes.
    Quads node = Quads(address_of(uvec2(structure), 1u, 128u));
    uint at = 4u * index;
    return Node(child_of_quads(node.quad[at], node.quad[at + 1u]), child_of_quads(node.quad[at + 2u], node.quad[at + 3u]));
#endif
}

Triangle triangle_at(Triangles triangles, uint index) {
#ifdef HEDGEROW_INT64
    return hedgerow_long_triangle(address_of(uvec2(triangles), index, 40u));
#else
    if (!IN_VECTORS) return triangles.triangle[index];
    return triangle_in_units(Units(uvec2(triangles)), UNITS_OF_ONE * index);
#endif
}
#endif
