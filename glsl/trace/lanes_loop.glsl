// The loop of the tracers that load lane by lane (trace/lanes.glsl): which ray a lane has, and when it takes the next one.
//
// All lanes stay in the loop until all rays of the workgroup are done: every lane can be asked what it needs. Rays that go the
// same way stay together: the next ones are taken when all lanes are done. Where more than half of the lanes' turns were spent waiting
// for the longest ray, each lane takes its next ray as soon as it can instead.
//
// Rays are loaded lane by lane, too: where rays part, a turn in two begins one, and eight gathers for it were 12% of the time.
//
// needs   as trace/lanes.glsl
#ifndef HEDGEROW_TRACE_LANES_LOOP
#define HEDGEROW_TRACE_LANES_LOOP
#include "trace/buffers.glsl"
#include "trace/lanes.glsl"

struct LaneRays {
    uint at;             // the lane's ray
    uint next;
    uint end;
    uint going;          // 1 or 0, as `together`: trace/query_walk.glsl says why these are no bools
    bool takes;          // in this turn: the next ray
    bool any_takes;      // of all lanes
    uint together;
    // Since all lanes took a ray: turns of the loop, and those in which this lane had a ray.
    uint turns;
    uint turns_going;
};

LaneRays lane_rays() {
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1u) * group_rays);
    return LaneRays(next, next, end, 0u, false, false, 1u, 0u, 0u);
}

// Whether any lane has a ray, or takes one. One sum says how many have one, and how many could take the next.
bool take_turn(inout LaneRays lane) {
    bool waits = lane.going == 0u && lane.next < lane.end;
    uint lanes = hedgerow_sum_of_lanes(lane.going | (waits ? 1u << 16 : 0u));
    bool none_goes = (lanes & 0xFFFFu) == 0u;
    if (none_goes) {
        bool stay = 2u * hedgerow_sum_of_lanes(lane.turns_going) >= gl_WorkGroupSize.x * lane.turns;
        lane.together = stay ? lane.together : 0u;
        lane.turns = 0u;
        lane.turns_going = 0u;
    }
    bool take = none_goes || lane.together == 0u;
    lane.any_takes = take && lanes >> 16 != 0u;
    lane.takes = take && waits;
    lane.at = lane.takes ? lane.next : lane.at;
    lane.next += lane.takes ? gl_WorkGroupSize.x : 0u;
    lane.going = lane.takes ? 1u : lane.going;
    lane.turns++;
    lane.turns_going += lane.going;
    return lanes != 0u;
}

// The rays of the lanes that take one.
HedgerowRay ray_of_each_lane(LaneRays of) {
    HedgerowEachLane index = hedgerow_each_lane(of.takes ? of.at : first);
    HedgerowRay mine = HEDGEROW_NO_RAY;
#define LOAD_RAY(lane)               \
    if (lane < hedgerow_lanes)       \
        mine = hedgerow_own_ray(gl_SubgroupInvocationID == lane, rays.ray[index.value[lane]], mine);
    HEDGEROW_FOR_EACH_LANE(LOAD_RAY)
    return mine;
}
#endif
