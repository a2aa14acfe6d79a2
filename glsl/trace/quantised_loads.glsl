// Quantised nodes as tracers load them: see trace/vector_loads.glsl. One in vectors is five loads of 128 bits in place of twenty.
#ifndef HEDGEROW_TRACE_QUANTISED_LOADS
#define HEDGEROW_TRACE_QUANTISED_LOADS
#include "bvh/wide.glsl"
#include "trace/vector_loads.glsl"

QuantisedNode quantised_node_at(QuantisedNodes nodes, uint index) {
#ifdef HEDGEROW_INT64
    return hedgerow_long_quantised_node(address_of(uvec2(nodes), index, 80u));
#else
    if (!IN_VECTORS) return nodes.node[index];
    Quads quads = Quads(uvec2(nodes));
    uint at = 5u * index;
    uvec4 a = quads.quad[at], b = quads.quad[at + 1u], c = quads.quad[at + 2u], d = quads.quad[at + 3u], e = quads.quad[at + 4u];
    return QuantisedNode(a.xyz, a.w, b.x, b.y, b.zw, uvec2[](c.xy, c.zw, d.xy), uvec2[](d.zw, e.xy, e.zw));
#endif
}
#endif
