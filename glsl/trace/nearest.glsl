// A triangle against the best hit so far: src/trace/host.rs, `Nearest`.
#ifndef HEDGEROW_TRACE_NEAREST
#define HEDGEROW_TRACE_NEAREST
#include "bvh/layout.glsl"
#include "trace/triangle.glsl"

// Whether the triangle is hit, and nearer than the best; of equally near ones the lower index wins.
bool hit_nearer(HedgerowPreparedRay ray, Triangle triangle, bool any_hit, inout float best, inout HedgerowHit hit) {
    vec3 met;
    bool nearer = hedgerow_meet(ray, triangle.v0, triangle.v1, triangle.v2, met) && ray.t_min < met.x && met.x < ray.t_max &&
                  (met.x < best || met.x == best && triangle.primitive < hit.primitive);
    if (nearer) {
        best = met.x;
        hit = HedgerowHit(any_hit ? 0.0 : met.x, triangle.primitive, met.y, met.z);
    }
    return nearer;
}
#endif
