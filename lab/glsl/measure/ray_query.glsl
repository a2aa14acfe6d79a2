// Traces rays by queries: the same source for the driver's (measure/ray_query.comp) and ours (measure/query.comp); and, with IN_TURN,
// ours with many rays for each invocation.
//
// reads   rays[first..count], the structure
// writes  hits[first..count]; works[first..count] where work is counted
// needs   a barrier (build -> read) before and one after; any subgroup size
#include "measure/rays.glsl"

// Ours are told that there are no boxes. The driver's are not: on lavapipe they are no faster so, and it is a feature of its own.
#ifdef HEDGEROW_TRACE_QUERY
#define QUERY inout rayQueryEXT query
const uint PRIMITIVES = gl_RayFlagsSkipAABBEXT;
#else
#define QUERY rayQueryEXT query
const uint PRIMITIVES = gl_RayFlagsNoneEXT;
#endif

// Every triangle is opaque, so that nothing is left to decide between candidates.
const uint FLAGS = gl_RayFlagsOpaqueEXT | PRIMITIVES | (ANY_HIT ? gl_RayFlagsTerminateOnFirstHitEXT : 0u);

void begin(QUERY, GivenRay ray) {
    rayQueryInitializeEXT(query, accelerationStructureEXT(structure), FLAGS, 0xFF, ray.origin, ray.t_min, ray.direction,
                          ray.t_max);
}

void report(QUERY, uint i) {
    Hit hit = no_hit();
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
        hit.t = ANY_HIT ? 0.0 : rayQueryGetIntersectionTEXT(query, true);
        // Instances are numbered by their first primitives, where those of several are to be told apart.
        hit.primitive = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true)) +
                        uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
        hit.u = uv.x;
        hit.v = uv.y;
    }
#ifdef HEDGEROW_COUNTS_WORK
    works.work[i] = query.work;
#endif
    hits.hit[i] = hit;
}

#ifdef IN_TURN
#include "trace/query_turns.glsl"
layout(constant_id = 3) const uint RAYS_EACH = 1;

// The next ray of an invocation that takes one: lane by lane where tracers load so (trace/lanes_loop.glsl).
GivenRay ray_of_turn(uint next, HedgerowTurns turns) {
#ifdef HEDGEROW_LANES
    GivenRay mine = HEDGEROW_NO_RAY;
    if (turns.any_takes) {
        HedgerowEachLane index = hedgerow_each_lane(turns.takes ? next : first);
#define LOAD_RAY(lane)                   \
        if (lane < hedgerow_lanes)       \
            mine = hedgerow_own_ray(gl_SubgroupInvocationID == lane, rays.ray[index.value[lane]], mine);
        HEDGEROW_FOR_EACH_LANE(LOAD_RAY)
    }
#else
    GivenRay mine;
    if (turns.takes) mine = rays.ray[next];
#endif
    return mine;
}

void main() {
    uint group_rays = gl_WorkGroupSize.x * RAYS_EACH;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1u) * group_rays);
    uint i = next;
    rayQueryEXT query;
    HedgerowTurns turns = hedgerowTurns(accelerationStructureEXT(structure));
    while (hedgerowTakeTurn(turns, next < end)) {
        GivenRay ray = ray_of_turn(next, turns);
        if (turns.takes) {
            i = next;
            next += gl_WorkGroupSize.x;
            begin(query, ray);
        }
        hedgerowRayQueryProceedInTurn(query, turns, FLAGS);
        if (hedgerowRayQueryEndsInTurn(query, turns)) report(query, i);
    }
}
#else
void main() {
    uint i = first + gl_GlobalInvocationID.x;
    if (i >= count) return;
    rayQueryEXT query;
    begin(query, rays.ray[i]);
    while (rayQueryProceedEXT(query)) {}
    report(query, i);
}
#endif
