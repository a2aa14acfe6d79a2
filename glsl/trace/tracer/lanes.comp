// Traces rays, each by one invocation, on CPUs: the loop of trace/lanes_loop.glsl, with loads lane by lane, and the steps of
// trace/tracer/single.comp.
//
// reads   structure, rays[first..count]
// writes  hits[first..count]; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; a workgroup of one subgroup of at most 16 lanes
#version 460
// Before the includes: the stack's arrays have the workgroup's size.
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
// Of rays that end at any hit.
layout(constant_id = 6) const bool LEFT_FIRST = false;
// Lanes of the workgroup: gl_WorkGroupSize.x by a constant of its own.
layout(constant_id = 4) const uint LANES = 16;
#define HEDGEROW_LANES LANES

#include "trace/lanes_loop.glsl"
#include "trace/walk.glsl"

Node node_of_each_lane(HedgerowEachLane index) {
    Node mine = HEDGEROW_NO_NODE;
#define LOAD_NODE(lane)              \
    if (lane < hedgerow_lanes)       \
        mine = hedgerow_own_node(gl_SubgroupInvocationID == lane, structure.nodes[index.value[lane]], mine);
    HEDGEROW_FOR_EACH_LANE(LOAD_NODE)
    return mine;
}

Triangle triangle_of_each_lane(Triangles triangles, HedgerowEachLane index) {
    Triangle mine = HEDGEROW_NO_TRIANGLE;
#define LOAD_TRIANGLE(lane)          \
    if (lane < hedgerow_lanes)       \
        mine = hedgerow_own_triangle(gl_SubgroupInvocationID == lane, triangles.triangle[index.value[lane]], mine);
    HEDGEROW_FOR_EACH_LANE(LOAD_TRIANGLE)
    return mine;
}

void step_to(Node node, inout Walk walk) {
    if (LEFT_FIRST) visit_left_first(node, walk);
    else visit(node, walk);
}

void main() {
    Triangles triangles = triangles_of(structure);
    Child root = structure.header.root;
    bool usable = can_be_traced(structure, KIND_TRIANGLES);
    Walk walk;
    walk.left = NOTHING;
    LaneRays lane = lane_rays();
    while (take_turn(lane)) {
        if (lane.any_takes) {
            HedgerowRay ray = ray_of_each_lane(lane);
            if (lane.takes) begin(ray, root, usable, walk);
        }
        // A lane that needs no node loads that of any lane that does: the root is one, or no lane is at a node.
        for (uint visits = 0; visits < 2; visits++) {
            HedgerowEachLane nodes = hedgerow_each_lane(at_node(walk) ? walk.index : root.index);
            if (at_node(walk)) step_to(node_of_each_lane(nodes), walk);
        }
        // There is a first triangle, or no lane is at one.
        HedgerowEachLane tests = hedgerow_each_lane(at_triangle(walk) ? walk.index : 0u);
        if (at_triangle(walk)) test(triangle_of_each_lane(triangles, tests), ANY_HIT, walk);
        if (lane.going != 0u && walk.left == NOTHING) {
            lane.going = (LEFT_FIRST ? go_on_left_first(walk) : go_on(walk)) ? 1u : 0u;
            if (lane.going == 0u) {
                hits.hit[lane.at] = walk.hit;
                if (COUNT_WORK) works.work[lane.at] = walk.work;
            }
        }
    }
}
