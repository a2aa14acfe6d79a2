// Loads at an address of each lane's own, one lane after the other: what CPUs do faster than gathering.
//
// An index that is broadcast from one lane is the same for all, so a driver that knows what is uniform loads it with plain
// instructions; each lane keeps what came from its own. Mesa 26's lavapipe does: a node of eight lanes is 128 plain loads in
// place of 16 gathers, and sponza is traced 1.2 to 1.4 times as fast on Zen 4 with AVX-512. Mesa 25's does not and takes three times
// as long as with gathers.
//
// needs   a workgroup of one subgroup of at most 16 lanes, all of them active at `each_lane` and `any_lane`
#ifndef HEDGEROW_TRACE_LANES
#define HEDGEROW_TRACE_LANES
#include "bvh/layout.glsl"
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

// Lanes of the workgroup, at most 16: gl_WorkGroupSize.x by a constant of its own. Compared as a variable, not in a constant expression:
// SwiftShader folds what is done to constants, but not constant expressions, and follows each of 2^16 paths through what is left.
layout(constant_id = 4) const uint LANES = 16;
uint lane_count = LANES;

// Lanes are named by constants: what is broadcast from a constant lane needs no feature and costs an instruction.
#define FOR_EACH_LANE(DO) DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7) DO(8) DO(9) DO(10) DO(11) DO(12) DO(13) DO(14) DO(15)

// A value of each lane, known to all of them.
struct EachLane {
    uint value[16];
};

EachLane each_lane(uint value) {
    EachLane each;
#define BROADCAST(lane) each.value[lane] = lane < lane_count ? subgroupBroadcast(value, lane) : 0u;
    FOR_EACH_LANE(BROADCAST)
    return each;
}

uint sum_of_lanes(uint value) {
    EachLane each = each_lane(value);
    uint sum = 0;
    for (uint lane = 0; lane < 16; lane++) sum += each.value[lane];
    return sum;
}

// Whether any lane says so. A vote is a loop over the lanes on lavapipe.
bool any_lane(bool says) {
    return sum_of_lanes(uint(says)) != 0u;
}

Child own_child(bool own, Child theirs, Child mine) {
    return Child(own ? theirs.lo : mine.lo, own ? theirs.index : mine.index, own ? theirs.hi : mine.hi, own ? theirs.count : mine.count);
}

Node node_of_each_lane(Structure structure, EachLane index) {
    Node mine = Node(Child(vec3(0.0), 0u, vec3(0.0), 0u), Child(vec3(0.0), 0u, vec3(0.0), 0u));
#define LOAD_NODE(lane)                                        \
    if (lane < lane_count) {                                        \
        Node theirs = structure.nodes[index.value[lane]];      \
        bool own = gl_SubgroupInvocationID == lane;            \
        mine.left = own_child(own, theirs.left, mine.left);    \
        mine.right = own_child(own, theirs.right, mine.right); \
    }
    FOR_EACH_LANE(LOAD_NODE)
    return mine;
}

Triangle triangle_of_each_lane(Triangles triangles, EachLane index) {
    Triangle mine = Triangle(vec3(0.0), vec3(0.0), vec3(0.0), 0u);
#define LOAD_TRIANGLE(lane)                                            \
    if (lane < lane_count) {                                                \
        Triangle theirs = triangles.triangle[index.value[lane]];       \
        bool own = gl_SubgroupInvocationID == lane;                    \
        mine.v0 = own ? theirs.v0 : mine.v0;                           \
        mine.v1 = own ? theirs.v1 : mine.v1;                           \
        mine.v2 = own ? theirs.v2 : mine.v2;                           \
        mine.primitive = own ? theirs.primitive : mine.primitive;      \
    }
    FOR_EACH_LANE(LOAD_TRIANGLE)
    return mine;
}
#endif
