// A round of a query whose nodes and triangles are loaded lane by lane (trace/lanes.glsl): a part of trace/query_turns.glsl.
//
// All lanes of the workgroup come here together, those without a ray as well. Two nodes of two are looked at in a round, as in
// trace/tracer/lanes.comp, or one of eight. What is rarer, instances and boxes, each lane loads for itself.
#ifndef HEDGEROW_TRACE_QUERY_LANES
#define HEDGEROW_TRACE_QUERY_LANES
// Until the end of this file.
#include "bvh/names.glsl"
#include "trace/lanes.glsl"

// Where each lane loads from: an element of an array. Of one level the array is the same for all lanes, and known to be; through two it is
// each lane's own.
struct HedgerowEachPlace {
    HedgerowEachLane low;
    HedgerowEachLane high;
    HedgerowEachLane index;
};

HedgerowEachPlace hedgerow_each_place(uvec2 array, uint index) {
    HedgerowEachPlace each;
    if (!HEDGEROW_ONE_LEVEL) {
        each.low = hedgerow_each_lane(array.x);
        each.high = hedgerow_each_lane(array.y);
    }
    each.index = hedgerow_each_lane(index);
    return each;
}

#define HEDGEROW_ARRAY_OF(lane) (HEDGEROW_ONE_LEVEL ? array : uvec2(each.low.value[lane], each.high.value[lane]))

Node hedgerow_node_of_each_lane(uvec2 array, uint index) {
    HedgerowEachPlace each = hedgerow_each_place(array, index);
    Node mine = HEDGEROW_NO_NODE;
#define HEDGEROW_LOAD_NODE(lane)                                                              \
    if (lane < hedgerow_lanes) {                                                              \
        Node theirs = HedgerowNodes(HEDGEROW_ARRAY_OF(lane)).node[each.index.value[lane]];    \
        mine = hedgerow_own_node(gl_SubgroupInvocationID == lane, theirs, mine);              \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_NODE)
    return mine;
}

Triangle hedgerow_triangle_of_each_lane(uvec2 array, uint index) {
    HedgerowEachPlace each = hedgerow_each_place(array, index);
    Triangle mine = HEDGEROW_NO_TRIANGLE;
#define HEDGEROW_LOAD_TRIANGLE(lane)                                                                  \
    if (lane < hedgerow_lanes) {                                                                      \
        Triangle theirs = Triangles(HEDGEROW_ARRAY_OF(lane)).triangle[each.index.value[lane]];        \
        mine = hedgerow_own_triangle(gl_SubgroupInvocationID == lane, theirs, mine);                  \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_TRIANGLE)
    return mine;
}

QuantisedNode hedgerow_quantised_node_of_each_lane(uvec2 array, uint index) {
    HedgerowEachPlace each = hedgerow_each_place(array, index);
    QuantisedNode mine = HEDGEROW_NO_QUANTISED_NODE;
#define HEDGEROW_LOAD_QUANTISED_NODE(lane)                                                                    \
    if (lane < hedgerow_lanes) {                                                                              \
        QuantisedNode theirs = QuantisedNodes(HEDGEROW_ARRAY_OF(lane)).node[each.index.value[lane]];          \
        mine = hedgerow_own_quantised_node(gl_SubgroupInvocationID == lane, theirs, mine);                    \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_QUANTISED_NODE)
    return mine;
}

Triangle hedgerow_first_of_each_lane(uvec2 array, uint unit) {
    HedgerowEachPlace each = hedgerow_each_place(array, unit);
    Triangle mine = HEDGEROW_NO_TRIANGLE;
#define HEDGEROW_LOAD_FIRST(lane)                                                                             \
    if (lane < hedgerow_lanes) {                                                                              \
        Triangle theirs = triangle_in_units(Units(HEDGEROW_ARRAY_OF(lane)), each.index.value[lane]);          \
        mine = hedgerow_own_triangle(gl_SubgroupInvocationID == lane, theirs, mine);                          \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_FIRST)
    return mine;
}

SecondOfPair hedgerow_second_of_each_lane(uvec2 array, uint unit) {
    HedgerowEachPlace each = hedgerow_each_place(array, unit);
    SecondOfPair mine = HEDGEROW_NO_SECOND;
#define HEDGEROW_LOAD_SECOND(lane)                                                                            \
    if (lane < hedgerow_lanes) {                                                                              \
        SecondOfPair theirs = second_in_units(Units(HEDGEROW_ARRAY_OF(lane)), each.index.value[lane]);        \
        mine = hedgerow_own_second(gl_SubgroupInvocationID == lane, theirs, mine);                            \
    }
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_LOAD_SECOND)
    return mine;
}

// The node at hand, of the lanes whose ray goes. `told` is the structure that hedgerowTurns was told of: what lanes load that need nothing
// lies at the beginning of it or, of one level, of its nodes and records.
void hedgerow_visit_in_lanes(inout HedgerowRayQuery query, bool goes, uvec2 told) {
    bool visits = goes && hedgerow_comes_to_node(query);
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_TWO) != 0u) {
        bool is_own = visits && !hedgerow_is_quantised(query);
        // Behind the header, which is as long as two nodes.
        uvec2 nodes = HEDGEROW_ONE_LEVEL || !is_own ? told : query.structure;
        Node node = hedgerow_node_of_each_lane(nodes, is_own ? 2u + query.index : 0u);
        if (is_own) hedgerow_visit_node(query, node);
    }
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_EIGHT) != 0u) {
        bool is_own = visits && hedgerow_is_quantised(query);
        uvec2 nodes = HEDGEROW_ONE_LEVEL ? wide_nodes_at(told) : is_own ? wide_nodes_at(query.structure) : told;
        QuantisedNode node = hedgerow_quantised_node_of_each_lane(nodes, is_own ? query.index : 0u);
        if (is_own) hedgerow_visit_quantised(query, node);
    }
}

// The triangles of the structure that hedgerowTurns was told of, which has one level; if it has boxes, its nodes.
uvec2 hedgerow_triangles_of_told(uvec2 told) {
    Header header = Structure(told).header;
    return records_of_kind(told, header.kind, has_boxes(header.kind) ? 0u : header.node_slots);
}

// The next record of a leaf, of the lanes that are at one; 1 if what was met is a candidate. Of quantised triangles a record may be two.
uint hedgerow_test_in_lanes(inout HedgerowRayQuery query, bool tests, uvec2 told) {
    uint waits = 0u;
    bool at_box = hedgerow_is_at_boxes(query);
    if (tests && at_box) waits = hedgerow_test_box(query);
    bool tests_triangle = tests && !at_box;
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_TWO) != 0u) {
        uint at = query.index;
        bool is_own = tests_triangle && !hedgerow_is_quantised(query);
        bool is_there = is_own && at < query.records;
        uvec2 triangles = HEDGEROW_ONE_LEVEL ? hedgerow_triangles_of_told(told)
                                             : is_there ? records_at(query.structure, query.slots) : told;
        Triangle triangle = hedgerow_triangle_of_each_lane(triangles, is_there ? at : 0u);
        if (is_own) {
            hedgerow_step(query);
            HEDGEROW_COUNT(w);
        }
        if (is_there) waits = hedgerow_meet_triangle(query, triangle, at);
    }
    if ((HEDGEROW_FORMS & HEDGEROW_NODES_OF_EIGHT) != 0u) {
        bool is_own = tests_triangle && hedgerow_is_quantised(query) && hedgerow_comes_to_record(query);
        uint unit = hedgerow_unit_of(query);
        uvec2 records = HEDGEROW_ONE_LEVEL ? hedgerow_triangles_of_told(told)
                                           : is_own ? wide_records_at(query.structure, query.slots, QUANTISED_NODE_BYTES) : told;
        Triangle first = hedgerow_first_of_each_lane(records, is_own ? unit : 0u);
        bool is_pair = is_own && hedgerow_is_pair(query, first);
        SecondOfPair second = hedgerow_second_of_each_lane(records, is_pair ? unit + UNITS_OF_ONE : 0u);
        if (is_own) waits = hedgerow_meet_pair(query, first, second, is_pair);
    }
    return waits;
}

// As a round of hedgerow_proceed, of the lanes whose ray goes; 1 if a candidate waits, and `ends` is 1 where nothing is left to do. The next node
// of a group is taken at the beginning, where it is loaded, and not at the end, where that would be a branch in two others.
uint hedgerow_round_of_lanes(inout HedgerowRayQuery query, bool goes, uvec2 told, out uint ends) {
    if (goes && hedgerow_is_quantised(query)) hedgerow_take_of_group(query);
    if (goes && hedgerow_has_record(query) && hedgerow_is_in_top(query)) hedgerow_enter_instance(query);
    hedgerow_visit_in_lanes(query, goes, told);
    if (HEDGEROW_FORMS == HEDGEROW_NODES_OF_TWO) hedgerow_visit_in_lanes(query, goes, told);
    if (goes && hedgerow_is_quantised(query)) hedgerow_take_leaf(query);
    bool tests = goes && hedgerow_has_record(query) && !hedgerow_is_in_top(query);
    uint waits = hedgerow_test_in_lanes(query, tests, told);
    ends = goes && query.rounds == 0u ? 1u : 0u;
    query.rounds -= goes ? 1u - ends : 0u;
    // A candidate is decided on before anything else is.
    if (goes && (ends | waits) == 0u && query.left == HEDGEROW_NOTHING) ends = hedgerow_go_back(query) ? 0u : 1u;
    if (ends != 0u) hedgerow_count_hit(query);
    return waits;
}

#include "bvh/names_end.glsl"
#endif
