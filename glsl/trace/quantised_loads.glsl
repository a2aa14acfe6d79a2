// Quantised nodes as tracers load them: see trace/vector_loads.glsl. One in vectors is five loads of 128 bits in place of twenty.
#ifndef HEDGEROW_TRACE_QUANTISED_LOADS
#define HEDGEROW_TRACE_QUANTISED_LOADS
#include "bvh/wide.glsl"
#include "trace/vector_loads.glsl"

QuantisedNode quantised_node_at(QuantisedNodes nodes, uint index) {
#ifdef HEDGEROW_INT64
    HedgerowLongs at = HedgerowLongs(address_of(uvec2(nodes), index, 80u));
    uvec4 a = hedgerow_quad_of(at, 0u), b = hedgerow_quad_of(at, 2u), c = hedgerow_quad_of(at, 4u), d = hedgerow_quad_of(at, 6u);
    uvec4 e = hedgerow_quad_of(at, 8u);
#else
    if (!IN_VECTORS) return nodes.node[index];
    Quads quads = Quads(uvec2(nodes));
    uint at = 5u * index;
    uvec4 a = quads.quad[at], b = quads.quad[at + 1u], c = quads.quad[at + 2u], d = quads.quad[at + 3u], e = quads.quad[at + 4u];
#endif
    return QuantisedNode(a.xyz, a.w, b.x, b.y, b.zw, uvec2[](c.xy, c.zw, d.xy), uvec2[](d.zw, e.xy, e.zw));
}
#endif
