// Loads at an address of each lane's own, one lane after the other: what CPUs do faster than gathering.
//
// An index that is broadcast from one lane is the same for all, so a driver that knows what is uniform loads it with plain
// instructions; each lane keeps what came from its own. Mesa 26's lavapipe does: a node of eight lanes is 128 plain loads in
// place of 16 gathers, and sponza is traced 1.2 to 1.4 times as fast on Zen 4 with AVX-512. Mesa 25's does not and takes three times
// as long as with gathers.
//
// What a lane keeps is selected word by word, never by a branch over the whole of a node: that would be a mask and a jump for each lane,
// and rays through quantised nodes have 1.08 times their speed without it.
//
// A shader defines HEDGEROW_LANES before it includes this file: how many lanes the workgroup has, a constant or specialisation constant.
//
// needs   a workgroup of one subgroup of at most 16 lanes, all of them active at `hedgerow_each_lane` and what calls it
#ifndef HEDGEROW_TRACE_LANES
#define HEDGEROW_TRACE_LANES
#include "bvh/layout.glsl"
#include "bvh/wide.glsl"
#include "bvh/wide/pairs.glsl"
#include "trace/ray.glsl"
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

// Compared as a variable, not in a constant expression: SwiftShader folds what is done to constants, but not constant expressions,
// and follows each of 2^16 paths through what is left.
uint hedgerow_lanes = HEDGEROW_LANES;

// Lanes are named by constants: what is broadcast from a constant lane needs no feature and costs an instruction.
#define HEDGEROW_FOR_EACH_LANE(DO) \
    DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7) DO(8) DO(9) DO(10) DO(11) DO(12) DO(13) DO(14) DO(15)

// A value of each lane, known to all of them.
struct HedgerowEachLane {
    uint value[16];
};

HedgerowEachLane hedgerow_each_lane(uint value) {
    HedgerowEachLane each;
#define HEDGEROW_BROADCAST(lane) each.value[lane] = lane < hedgerow_lanes ? subgroupBroadcast(value, lane) : 0u;
    HEDGEROW_FOR_EACH_LANE(HEDGEROW_BROADCAST)
    return each;
}

// In place of a vote, too, which is a loop over the lanes on lavapipe.
uint hedgerow_sum_of_lanes(uint value) {
    HedgerowEachLane each = hedgerow_each_lane(value);
    uint sum = 0;
    for (uint lane = 0; lane < 16; lane++) sum += each.value[lane];
    return sum;
}

uint hedgerow_max_of_lanes(uint value) {
    HedgerowEachLane each = hedgerow_each_lane(value);
    uint most = 0;
    for (uint lane = 0; lane < 16; lane++) most = max(most, each.value[lane]);
    return most;
}

Child hedgerow_own_child(bool own, Child theirs, Child mine) {
    return Child(own ? theirs.lo : mine.lo, own ? theirs.index : mine.index, own ? theirs.hi : mine.hi,
                 own ? theirs.count : mine.count);
}

Node hedgerow_own_node(bool own, Node theirs, Node mine) {
    return Node(hedgerow_own_child(own, theirs.left, mine.left), hedgerow_own_child(own, theirs.right, mine.right));
}

Triangle hedgerow_own_triangle(bool own, Triangle theirs, Triangle mine) {
    return Triangle(own ? theirs.v0 : mine.v0, own ? theirs.v1 : mine.v1, own ? theirs.v2 : mine.v2,
                    own ? theirs.primitive : mine.primitive);
}

QuantisedNode hedgerow_own_quantised_node(bool own, QuantisedNode theirs, QuantisedNode mine) {
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

SecondOfPair hedgerow_own_second(bool own, SecondOfPair theirs, SecondOfPair mine) {
    return SecondOfPair(own ? theirs.vertex : mine.vertex, own ? theirs.primitive : mine.primitive);
}

HedgerowRay hedgerow_own_ray(bool own, HedgerowRay theirs, HedgerowRay mine) {
    return HedgerowRay(own ? theirs.origin : mine.origin, own ? theirs.t_min : mine.t_min, own ? theirs.direction : mine.direction,
                       own ? theirs.t_max : mine.t_max);
}

// What a lane has before anything was loaded for it.
const HedgerowRay HEDGEROW_NO_RAY = HedgerowRay(vec3(0.0), 0.0, vec3(0.0), 0.0);
const Child HEDGEROW_NO_CHILD = Child(vec3(0.0), 0u, vec3(0.0), 0u);
const Node HEDGEROW_NO_NODE = Node(HEDGEROW_NO_CHILD, HEDGEROW_NO_CHILD);
const Triangle HEDGEROW_NO_TRIANGLE = Triangle(vec3(0.0), vec3(0.0), vec3(0.0), 0u);
const SecondOfPair HEDGEROW_NO_SECOND = SecondOfPair(vec3(0.0), 0u);
const uvec2 HEDGEROW_NO_BYTES[3] = uvec2[3](uvec2(0u), uvec2(0u), uvec2(0u));
const QuantisedNode HEDGEROW_NO_QUANTISED_NODE =
    QuantisedNode(uvec3(0u), 0u, 0u, 0u, uvec2(0u), HEDGEROW_NO_BYTES, HEDGEROW_NO_BYTES);
#endif
