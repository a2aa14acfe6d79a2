// The box test that never hides a hit: the twin of src/trace/slab.rs, which proves it.
#ifndef HEDGEROW_TRACE_SLAB
#define HEDGEROW_TRACE_SLAB
#include "trace/ray.glsl"

// By how much boxes are widened whose corners are no farther from the origin along any axis; finite, that no box beyond the
// floats' end makes it a NaN.
float hedgerow_slack_of(HedgerowPreparedRay ray, vec3 farthest) {
    const float GREATEST = uintBitsToFloat(0x7f7fffffu);
    float power_of_two = uintBitsToFloat(floatBitsToUint(max(max(farthest.x, farthest.y), farthest.z)) & 0x7f800000u);
    precise float slack = ray.slack * power_of_two + ray.margin;
    return min(slack, GREATEST);
}

// Where the ray enters the box, and in `entered` whether it does between t_min and t_best.
float hedgerow_enter(HedgerowPreparedRay ray, vec3 box_lo, vec3 box_hi, float t_best, out bool entered) {
    precise vec3 before = ray.origin - box_lo;
    precise vec3 behind = box_hi - ray.origin;
    float slack = hedgerow_slack_of(ray, max(before, behind));
    precise vec3 lo = (before + slack) * -ray.inverse;
    precise vec3 hi = (behind + slack) * ray.inverse;
    vec3 near = min(lo, hi);
    vec3 far = max(lo, hi);
    float enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    float leave = min(min(far.x, far.y), min(far.z, t_best));
    entered = enter <= leave;
    return enter;
}
#endif
