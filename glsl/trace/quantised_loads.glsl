// Quantised nodes and their records as tracers load them: see trace/vector_loads.glsl. One in vectors is five loads of 128 bits in place of twenty.
#ifndef HEDGEROW_TRACE_QUANTISED_LOADS
#define HEDGEROW_TRACE_QUANTISED_LOADS
#include "bvh/wide.glsl"
#include "bvh/wide/pairs.glsl"
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

// The triangle that begins in a unit, as it lies in memory.
Triangle triangle_at_unit(uvec2 records, uint unit) {
#ifdef HEDGEROW_INT64
    return hedgerow_long_triangle(record_at_unit(records, unit));
#else
    return IN_VECTORS ? triangle_in_units(Units(records), unit) : Triangles(record_at_unit(records, unit)).triangle[0];
#endif
}

SecondOfPair second_of_pair_at(uvec2 records, uint unit) {
#ifdef HEDGEROW_INT64
    return hedgerow_long_second_of_pair(second_at_unit(records, unit));
#else
    return SecondsOfPairs(second_at_unit(records, unit)).second[0];
#endif
}
#endif
