// The box test that never hides a hit: the twin of src/trace/slab.rs, which proves it.
#ifndef HEDGEROW_TRACE_SLAB
#define HEDGEROW_TRACE_SLAB
#include "trace/ray.glsl"

// Where the ray enters the box, and in `entered` whether it does between t_min and t_best.
float hedgerow_enter(HedgerowPreparedRay ray, vec3 box_lo, vec3 box_hi, float t_best, out bool entered) {
    vec3 lo = (box_lo - ray.origin_lo) * ray.inverse;
    vec3 hi = (box_hi - ray.origin_hi) * ray.inverse;
    vec3 near = min(lo, hi);
    vec3 far = max(lo, hi);
    float enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    float leave = min(min(far.x, far.y), min(far.z, t_best));
    entered = enter <= leave;
    return enter;
}
#endif
