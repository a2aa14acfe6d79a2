// A round of a query whose nodes and triangles are loaded lane by lane (trace/lanes.glsl): a part of trace/query_turns.glsl.
//
// All lanes of the workgroup come here together, those without a ray as well. Two nodes of two are looked at in a round, as in
// trace/tracer/lanes.comp, or one of eight. What is rarer, instances and boxes, each lane loads for itself.
#ifndef HEDGEROW_TRACE_QUERY_LANES
#define HEDGEROW_TRACE_QUERY_LANES
// Until the end of this file.
#include "bvh/names.glsl"
#include "trace/lanes.glsl"

Node hedgerow_node_of_each_lane(uvec2 address) {
    HedgerowEachLane low = hedgerow_each_lane(address.x), high = hedgerow_each_lane(address.y);
    Node mine = HEDGEROW_NO_NODE;
#define HEDGEROW_LOAD_NODE(lane)                                                         \
    if (lane < hedgerow_lanes) {                                                         \
        Node theirs = HedgerowNodes(uvec2(low.value[lane], high.value[lane])).node[0];   \
        mine = hedgerow_own_node(gl_SubgroupInvocationID == lane, theirs, mine);         \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_NODE)
    return mine;
}

Triangle hedgerow_triangle_of_each_lane(uvec2 address) {
    HedgerowEachLane low = hedgerow_each_lane(address.x), high = hedgerow_each_lane(address.y);
    Triangle mine = HEDGEROW_NO_TRIANGLE;
#define HEDGEROW_LOAD_TRIANGLE(lane)                                                         \
    if (lane < hedgerow_lanes) {                                                             \
        Triangle theirs = Triangles(uvec2(low.value[lane], high.value[lane])).triangle[0];   \
        mine = hedgerow_own_triangle(gl_SubgroupInvocationID == lane, theirs, mine);         \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_TRIANGLE)
    return mine;
}

QuantisedNode hedgerow_quantised_node_of_each_lane(uvec2 address) {
    HedgerowEachLane low = hedgerow_each_lane(address.x), high = hedgerow_each_lane(address.y);
    QuantisedNode mine = HEDGEROW_NO_QUANTISED_NODE;
#define HEDGEROW_LOAD_QUANTISED_NODE(lane)                                                               \
    if (lane < hedgerow_lanes) {                                                                         \
        QuantisedNode theirs = QuantisedNodes(uvec2(low.value[lane], high.value[lane])).node[0];         \
        mine = hedgerow_own_quantised_node(gl_SubgroupInvocationID == lane, theirs, mine);               \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_QUANTISED_NODE)
    return mine;
}

SecondOfPair hedgerow_second_of_each_lane(uvec2 address) {
    HedgerowEachLane low = hedgerow_each_lane(address.x), high = hedgerow_each_lane(address.y);
    SecondOfPair mine = HEDGEROW_NO_SECOND;
#define HEDGEROW_LOAD_SECOND(lane)                                                                    \
    if (lane < hedgerow_lanes) {                                                                      \
        SecondOfPair theirs = SecondsOfPairs(uvec2(low.value[lane], high.value[lane])).second[0];     \
        mine = hedgerow_own_second(gl_SubgroupInvocationID == lane, theirs, mine);                    \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_SECOND)
    return mine;
}

// The node at hand, of the lanes whose ray goes. `readable` is the address of 80 bytes or more, for lanes that need nothing.
void hedgerow_visit_in_lanes(inout HedgerowRayQuery query, bool goes, uvec2 readable) {
    bool visits = goes && hedgerow_comes_to_node(query);
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_TWO) != 0u) {
        bool is_own = visits && !hedgerow_is_quantised(query);
        uvec2 address = is_own ? hedgerow_node_address(query.structure, query.index) : readable;
        Node node = hedgerow_node_of_each_lane(address);
        if (is_own) hedgerow_visit_node(query, node);
    }
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_EIGHT) != 0u) {
        bool is_own = visits && hedgerow_is_quantised(query);
        uvec2 address = is_own ? address_of(wide_nodes_at(query.structure), query.index, QUANTISED_NODE_BYTES) : readable;
        QuantisedNode node = hedgerow_quantised_node_of_each_lane(address);
        if (is_own) hedgerow_visit_quantised(query, node);
    }
}

// The next record of a leaf, of the lanes that are at one; true if what was met is a candidate. Of quantised triangles a record may be two.
bool hedgerow_test_in_lanes(inout HedgerowRayQuery query, bool tests, uvec2 readable) {
    bool waits = false;
    uvec2 records = hedgerow_records_in(query.structure, query.slots, query.form);
    bool has_boxes = (query.form & FORM_BOXES) != 0u;
    if (tests && has_boxes) waits = hedgerow_test_box(query);
    bool tests_triangle = tests && !has_boxes;
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_TWO) != 0u) {
        uint at = query.index;
        bool is_own = tests_triangle && !hedgerow_is_quantised(query);
        bool is_there = is_own && at < query.records;
        Triangle triangle = hedgerow_triangle_of_each_lane(is_there ? address_of(records, at, 40u) : readable);
        if (is_own) {
            hedgerow_step(query);
            HEDGEROW_COUNT(w);
        }
        if (is_there) waits = hedgerow_meet_triangle(query, triangle, at);
    }
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_EIGHT) != 0u) {
        bool is_own = tests_triangle && hedgerow_is_quantised(query) && hedgerow_comes_to_record(query);
        uint unit = hedgerow_unit_of(query);
        Triangle first = hedgerow_triangle_of_each_lane(is_own ? record_at_unit(records, unit) : readable);
        bool is_pair = is_own && hedgerow_is_pair(query, first);
        SecondOfPair second = hedgerow_second_of_each_lane(is_pair ? second_at_unit(records, unit) : readable);
        if (is_own) waits = hedgerow_meet_pair(query, first, second, is_pair);
    }
    return waits;
}

// As a round of hedgerow_proceed, of the lanes whose ray goes.
bool hedgerow_round_of_lanes(inout HedgerowRayQuery query, bool goes, uvec2 readable, out bool ends) {
    if (goes && hedgerow_has_record(query) && hedgerow_is_in_top(query)) hedgerow_enter_instance(query);
    hedgerow_visit_in_lanes(query, goes, readable);
    if (HEDGEROW_FORMS == HEDGEROW_NODES_OF_TWO) hedgerow_visit_in_lanes(query, goes, readable);
    if (goes && hedgerow_is_quantised(query)) hedgerow_take_leaf(query);
    bool tests = goes && hedgerow_has_record(query) && !hedgerow_is_in_top(query);
    bool waits = hedgerow_test_in_lanes(query, tests, readable);
    ends = false;
    if (goes) {
        ends = query.rounds == 0u;
        query.rounds -= ends ? 0u : 1u;
        // A candidate is decided on before anything else is.
        if (!ends && !waits && query.left == HEDGEROW_NOTHING) ends = !hedgerow_go_on(query);
        if (ends) hedgerow_count_hit(query);
    }
    return waits;
}

#include "bvh/names_end.glsl"
#endif
