// Traces rays through a tree of quantised nodes, each by one invocation, on CPUs: the loop of trace/tracer/lanes.comp, with loads
// lane by lane (trace/lanes.glsl), and the steps of trace/wide/octant.comp.
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

#include "trace/lanes.glsl"
#include "trace/walk_quantised.glsl"

QuantisedNode own_quantised(bool own, QuantisedNode theirs, QuantisedNode mine) {
    QuantisedNode kept = QuantisedNode(own ? theirs.origin : mine.origin,
                                       own ? theirs.exponents_and_nodes : mine.exponents_and_nodes,
                                       own ? theirs.first_child : mine.first_child,
                                       own ? theirs.first_record : mine.first_record,
                                       own ? theirs.counts : mine.counts, mine.lo, mine.hi);
    [[unroll]] for (uint axis = 0; axis < 3; ++axis) {
        kept.lo[axis] = own ? theirs.lo[axis] : mine.lo[axis];
        kept.hi[axis] = own ? theirs.hi[axis] : mine.hi[axis];
    }
    return kept;
}

QuantisedNode quantised_node_of_each_lane(QuantisedNodes nodes, HedgerowEachLane index) {
    const uvec2 none[3] = uvec2[3](uvec2(0u), uvec2(0u), uvec2(0u));
    QuantisedNode mine = QuantisedNode(uvec3(0u), 0u, 0u, 0u, uvec2(0u), none, none);
#define LOAD_QUANTISED(lane)         \
    if (lane < hedgerow_lanes)       \
        mine = own_quantised(gl_SubgroupInvocationID == lane, nodes.node[index.value[lane]], mine);
    HEDGEROW_FOR_EACH_LANE(LOAD_QUANTISED)
    return mine;
}

Triangle record_of_each_lane(uvec2 records, HedgerowEachLane unit) {
    Triangle mine = HEDGEROW_NO_TRIANGLE;
#define LOAD_RECORD(lane)                                                                              \
    if (lane < hedgerow_lanes) {                                                                       \
        Triangle theirs = Triangles(record_at_unit(records, unit.value[lane])).triangle[0];            \
        mine = hedgerow_own_triangle(gl_SubgroupInvocationID == lane, theirs, mine);                   \
    }
    HEDGEROW_FOR_EACH_LANE(LOAD_RECORD)
    return mine;
}

// What lies in a unit of each lane as behind the first of two triangles.
SecondOfPair second_of_each_lane(uvec2 records, HedgerowEachLane unit) {
    SecondOfPair mine = SecondOfPair(vec3(0.0), 0u);
#define LOAD_SECOND(lane)                                                                                      \
    if (lane < hedgerow_lanes) {                                                                               \
        SecondOfPair theirs = SecondsOfPairs(record_at_unit(records, unit.value[lane])).second[0];             \
        bool own = gl_SubgroupInvocationID == lane;                                                            \
        mine = SecondOfPair(own ? theirs.vertex : mine.vertex, own ? theirs.primitive : mine.primitive);       \
    }
    HEDGEROW_FOR_EACH_LANE(LOAD_SECOND)
    return mine;
}

void main() {
    if (LEAVES_OTHERS && structure.header.kind != KIND_TRIANGLES_8Q) return;
    uvec2 records = wide_records_at(uvec2(structure), structure.header.node_slots, QUANTISED_NODE_BYTES);
    QuantisedNodes nodes = QuantisedNodes(wide_nodes_at(uvec2(structure)));
    Child root = structure.header.root;
    bool usable = can_be_traced(structure, KIND_TRIANGLES_8Q);
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1) * group_rays);

    QuantisedWalk walk;
    walk.visits = 0;
    walk.leaves = 0;
    walk.left = 0;
    bool going = false;
    uint i;
    bool together = true;
    // Since all lanes took a ray: turns of the loop, and those in which this lane had a ray.
    uint turns = 0, turns_going = 0;
    while (true) {
        bool none_goes = !hedgerow_any_lane(going);
        if (none_goes) {
            if (!hedgerow_any_lane(next < end)) break;
            together = together && 2u * hedgerow_sum_of_lanes(turns_going) >= gl_WorkGroupSize.x * turns;
            turns = 0;
            turns_going = 0;
        }
        turns++;
        if (!going && next < end && (none_goes || !together)) {
            i = next;
            next += gl_WorkGroupSize.x;
            begin(rays.ray[i], root, usable, walk);
            going = true;
        }
        if (going) turns_going++;
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
        if (going) {
            going = go_on(walk);
            if (!going) {
                hits.hit[i] = walk.hit;
                if (COUNT_WORK) works.work[i] = walk.work;
            }
        }
    }
}
