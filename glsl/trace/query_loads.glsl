// What a query loads: nodes, triangles and records of instances, each invocation its own.
//
// A shader that defines HEDGEROW_INT64 before it includes trace/query.glsl loads elements of 64 bits: see trace/long_loads.glsl. The same
// rays then hit the same. Quantised nodes it loads so where HEDGEROW_LONG_NODES, a constant or specialisation constant, is true, and otherwise
// member by member: on lavapipe that gains on a CPU which gathers words fast, and loses on others (src/gpu/tuning.rs).
#ifndef HEDGEROW_TRACE_QUERY_LOADS
#define HEDGEROW_TRACE_QUERY_LOADS
#include "bvh/wide.glsl"
#include "bvh/wide/pairs.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer HedgerowNodes { Node node[]; };

// What a quantised node says of its children beside their boxes.
struct HedgerowNames {
    uint nodes;
    uint first_child;
    uint first_record;
    uvec2 counts;
};

// Of a node in a structure, behind the header's 128 bytes.
uvec2 hedgerow_node_address(uvec2 structure, uint index) {
    return address_of(structure, 2u + index, 64u);
}

#ifdef HEDGEROW_INT64
#include "trace/long_loads.glsl"

Node hedgerow_node_at(uvec2 structure, uint index) {
    return hedgerow_long_node(hedgerow_node_address(structure, index));
}

#ifndef HEDGEROW_LONG_NODES
#define HEDGEROW_LONG_NODES false
#endif

QuantisedNode hedgerow_quantised_node_at(uvec2 structure, uint index) {
    uvec2 at = address_of(wide_nodes_at(structure), index, QUANTISED_NODE_BYTES);
    QuantisedNode node;
    if (HEDGEROW_LONG_NODES) node = hedgerow_long_quantised_node(at);
    else node = QuantisedNodes(at).node[0];
    return node;
}

HedgerowNames hedgerow_names_at(uvec2 structure, uint index) {
    HedgerowLongs at = HedgerowLongs(address_of(wide_nodes_at(structure), index, QUANTISED_NODE_BYTES));
    uvec2 first = hedgerow_pair_of(at, 2u);
    return HedgerowNames(hedgerow_pair_of(at, 1u).y >> 24, first.x, first.y, hedgerow_pair_of(at, 3u));
}

Triangle hedgerow_triangle_at(uvec2 triangles, uint index) {
    return hedgerow_long_triangle(address_of(triangles, index, 40u));
}

Triangle hedgerow_triangle_at_unit(uvec2 records, uint unit) {
    return hedgerow_long_triangle(record_at_unit(records, unit));
}

SecondOfPair hedgerow_second_of_pair_at(uvec2 records, uint unit) {
    return hedgerow_long_second_of_pair(second_at_unit(records, unit));
}

// Without `to_world`, which no ray needs on its way.
Instance hedgerow_instance_at(uvec2 instances, uint index) {
    HedgerowLongs at = HedgerowLongs(address_of(instances, index, 128u));
    const vec4 none[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    vec4 to_object[3] = vec4[3](uintBitsToFloat(hedgerow_quad_of(at, 0u)), uintBitsToFloat(hedgerow_quad_of(at, 2u)),
                                uintBitsToFloat(hedgerow_quad_of(at, 4u)));
    uvec4 a = hedgerow_quad_of(at, 12u), b = hedgerow_quad_of(at, 14u);
    return Instance(to_object, none, a.xy, a.z, a.w, b.x, b.y, b.z, b.w);
}
#else
Node hedgerow_node_at(uvec2 structure, uint index) {
    return HedgerowNodes(hedgerow_node_address(structure, index)).node[0];
}

QuantisedNode hedgerow_quantised_node_at(uvec2 structure, uint index) {
    return QuantisedNodes(address_of(wide_nodes_at(structure), index, QUANTISED_NODE_BYTES)).node[0];
}

HedgerowNames hedgerow_names_at(uvec2 structure, uint index) {
    QuantisedNodes at = QuantisedNodes(address_of(wide_nodes_at(structure), index, QUANTISED_NODE_BYTES));
    return HedgerowNames(at.node[0].exponents_and_nodes >> 24, at.node[0].first_child, at.node[0].first_record, at.node[0].counts);
}

Triangle hedgerow_triangle_at(uvec2 triangles, uint index) {
    return Triangles(triangles).triangle[index];
}

Triangle hedgerow_triangle_at_unit(uvec2 records, uint unit) {
    return Triangles(record_at_unit(records, unit)).triangle[0];
}

SecondOfPair hedgerow_second_of_pair_at(uvec2 records, uint unit) {
    return SecondsOfPairs(second_at_unit(records, unit)).second[0];
}

Instance hedgerow_instance_at(uvec2 instances, uint index) {
    return Instances(instances).instance[index];
}
#endif

// In what names a record of quantised triangles beside its unit: its second triangle.
const uint HEDGEROW_SECOND = 1u << 31;

Triangle hedgerow_triangle_of_record(uvec2 records, uint record) {
    uint unit = record & ~HEDGEROW_SECOND;
    Triangle first = hedgerow_triangle_at_unit(records, unit);
    if (record == unit) return first_of_pair(first);
    return second_of_pair(first, hedgerow_second_of_pair_at(records, unit));
}
#endif
