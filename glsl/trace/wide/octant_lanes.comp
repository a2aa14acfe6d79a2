// Traces rays through a tree of quantised nodes, each by one invocation, on CPUs: the loop of trace/lanes_loop.glsl, with loads
// lane by lane, and the steps of trace/wide/octant.comp.
//
// reads   structure, rays[first..count]
// writes  hits[first..count]; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; a workgroup of one subgroup of at most 16 lanes
#version 460
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
// Where the structure is of another kind, hits stay what they are.
layout(constant_id = 7) const bool LEAVES_OTHERS = false;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
#define HEDGEROW_LEVELS 49

// Lanes of the workgroup: gl_WorkGroupSize.x by a constant of its own.
layout(constant_id = 4) const uint LANES = 16;
#define HEDGEROW_LANES LANES

#include "trace/lanes_loop.glsl"
#include "trace/quantised_loads.glsl"
#include "trace/walk_quantised.glsl"

QuantisedNode quantised_node_of_each_lane(QuantisedNodes nodes, HedgerowEachLane index) {
    QuantisedNode mine = HEDGEROW_NO_QUANTISED_NODE;
#define LOAD_QUANTISED(lane)         \
    if (lane < hedgerow_lanes)       \
        mine = hedgerow_own_quantised_node(gl_SubgroupInvocationID == lane, nodes.node[index.value[lane]], mine);
    HEDGEROW_FOR_EACH_LANE(LOAD_QUANTISED)
    return mine;
}

Triangle record_of_each_lane(Units records, HedgerowEachLane unit) {
    Triangle mine = HEDGEROW_NO_TRIANGLE;
#define LOAD_RECORD(lane)            \
    if (lane < hedgerow_lanes)       \
        mine = hedgerow_own_triangle(gl_SubgroupInvocationID == lane, triangle_in_units(records, unit.value[lane]), mine);
    HEDGEROW_FOR_EACH_LANE(LOAD_RECORD)
    return mine;
}

// What lies in a unit of each lane as behind the first of two triangles.
SecondOfPair second_of_each_lane(Units records, HedgerowEachLane unit) {
    SecondOfPair mine = HEDGEROW_NO_SECOND;
#define LOAD_SECOND(lane)            \
    if (lane < hedgerow_lanes)       \
        mine = hedgerow_own_second(gl_SubgroupInvocationID == lane, second_in_units(records, unit.value[lane]), mine);
    HEDGEROW_FOR_EACH_LANE(LOAD_SECOND)
    return mine;
}

void main() {
    if (LEAVES_OTHERS && structure.header.kind != KIND_TRIANGLES_8Q) return;
    Units records = Units(wide_records_at(uvec2(structure), structure.header.node_slots, QUANTISED_NODE_BYTES));
    QuantisedNodes nodes = QuantisedNodes(wide_nodes_at(uvec2(structure)));
    Child root = structure.header.root;
    bool usable = can_be_traced(structure, KIND_TRIANGLES_8Q);
    QuantisedWalk walk;
    walk.visits = 0;
    walk.leaves = 0;
    walk.left = 0;
    LaneRays lane = lane_rays();
    while (take_turn(lane)) {
        if (lane.any_takes) {
            HedgerowRay ray = ray_of_each_lane(lane);
            if (lane.takes) begin(ray, root, usable, walk);
        }
        // A lane that needs no node loads the root; one that needs no triangle the first, if any lane is at one.
        bool visits = at_node(walk);
        uint index = visits ? next_node(walk) : 0u;
        QuantisedNode node = quantised_node_of_each_lane(nodes, hedgerow_each_lane(index));
        if (visits) visit(node, ANY_HIT, walk);
        next_leaf(walk);
        bool tests = at_triangle(walk);
        HedgerowEachLane unit = hedgerow_each_lane(tests ? walk.record : 0u);
        Triangle triangle = record_of_each_lane(records, unit);
        // Where there is no second, the beginning of the first.
        bool is_pair = tests && has_second(triangle);
        SecondOfPair second = second_of_each_lane(records, hedgerow_each_lane(is_pair ? walk.record + UNITS_OF_ONE : 0u));
        if (tests) test_record(triangle, second, ANY_HIT, walk);
        if (lane.going != 0u) {
            lane.going = go_on(walk) ? 1u : 0u;
            if (lane.going == 0u) {
                hits.hit[lane.at] = walk.hit;
                if (COUNT_WORK) works.work[lane.at] = walk.work;
            }
        }
    }
}
