// Traces rays by queries: the same source for the driver's (measure/ray_query.comp) and ours (measure/query.comp).
//
// reads   rays[first..count], the structure
// writes  hits[first..count]; works[first..count] where work is counted
// needs   a barrier (build -> read) before and one after; any subgroup size
#include "measure/rays.glsl"

void main() {
    uint i = first + gl_GlobalInvocationID.x;
    if (i >= count) return;
    GivenRay ray = rays.ray[i];

    rayQueryEXT query;
    const uint flags = gl_RayFlagsOpaqueEXT | (ANY_HIT ? gl_RayFlagsTerminateOnFirstHitEXT : 0u);
    rayQueryInitializeEXT(query, accelerationStructureEXT(structure), flags, 0xFF, ray.origin, ray.t_min, ray.direction,
                          ray.t_max);
    // Every triangle is opaque, so that nothing is left to decide between candidates.
    while (rayQueryProceedEXT(query)) {}

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
