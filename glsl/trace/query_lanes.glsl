// A round of a query whose nodes and triangles are loaded lane by lane (trace/lanes.glsl): a part of trace/query_turns.glsl.
//
// All lanes of the workgroup come here together, those without a ray as well. Two nodes are looked at in a round, as in
// trace/tracer/lanes.comp. What is rarer, instances and boxes, each lane loads for itself.
#ifndef HEDGEROW_TRACE_QUERY_LANES
#define HEDGEROW_TRACE_QUERY_LANES
#ifdef HEDGEROW_ALL_FORMS
#error "HEDGEROW_LANES is for structures of nodes of two: define HEDGEROW_FORMS as HEDGEROW_NODES_OF_TWO before trace/query.glsl"
#endif
// Until the end of this file.
#include "bvh/names.glsl"
#include "trace/lanes.glsl"

// An address that any lane has, or 0.
uvec2 hedgerow_address_of_any_lane(uvec2 address) {
    HedgerowEachLane low = hedgerow_each_lane(address.x), high = hedgerow_each_lane(address.y);
    uvec2 any = uvec2(0u);
    for (uint lane = 0; lane < 16; lane++) {
        if ((low.value[lane] | high.value[lane]) != 0u) any = uvec2(low.value[lane], high.value[lane]);
    }
    return any;
}

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

// As a round of hedgerow_proceed, of the lanes whose ray goes. `readable` is the address of 64 bytes or more, for lanes that need nothing.
bool hedgerow_round_of_lanes(inout HedgerowRayQuery query, bool goes, uvec2 readable, out bool ends) {
    if (goes && hedgerow_has_record(query) && hedgerow_is_in_top(query)) hedgerow_enter_instance(query);
    for (uint visit = 0; visit < 2; visit++) {
        bool visits = goes && hedgerow_comes_to_node(query);
        uvec2 address = visits ? hedgerow_node_address(query.structure, query.index) : readable;
        Node node = hedgerow_node_of_each_lane(address);
        if (visits) hedgerow_visit_node(query, node);
    }
    bool waits = false;
    bool tests = goes && hedgerow_has_record(query) && !hedgerow_is_in_top(query);
    uint at = query.index;
    bool is_there = tests && at < query.records;
    bool tests_triangle = is_there && (query.form & FORM_BOXES) == 0u;
    uvec2 records = hedgerow_records_in(query.structure, query.slots, query.form);
    Triangle triangle = hedgerow_triangle_of_each_lane(tests_triangle ? address_of(records, at, 40u) : readable);
    if (tests && (query.form & FORM_BOXES) == 0u) {
        hedgerow_step(query);
        HEDGEROW_COUNT(w);
        if (is_there) waits = hedgerow_meet_triangle(query, triangle, at);
    } else if (tests) {
        waits = hedgerow_test_box(query);
    }
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
