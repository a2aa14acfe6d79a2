// A ray made ready for the tests, computed once: the twin of src/trace/ray.rs, which says why.
#ifndef HEDGEROW_TRACE_RAY
#define HEDGEROW_TRACE_RAY
#include "gpu/reciprocal.glsl"

#define HEDGEROW_INFINITY uintBitsToFloat(0x7f800000u)
const uint HEDGEROW_NONE = 0xffffffffu;
// 2^-17: the slack of a ray that is made ready, in src/trace/ray.rs.
#define HEDGEROW_SLACK uintBitsToFloat((127u - 17u) << 23)

struct HedgerowRay {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

struct HedgerowHit {
    float t;
    uint primitive;
    float u;
    float v;
};

struct HedgerowPreparedRay {
    vec3 origin;
    float t_min;
    float t_max;
    uint major;
    vec3 shear;
    vec3 inverse;
    // By what part of the power of two below its distance a box is widened, and by how much however near it is.
    float slack;
    float margin;
};

bool hedgerow_finite(vec3 x) {
    return all(notEqual(floatBitsToUint(x) & 0x7f800000u, uvec3(0x7f800000u)));
}

// The components of v with the major axis last and the two that follow it before.
vec3 hedgerow_permuted(vec3 v, uint major) {
    return major == 2u ? v : major == 1u ? v.zxy : v.yzx;
}

// Whether the ray can hit anything at all, and what the tests need of it.
bool hedgerow_prepare(HedgerowRay ray, out HedgerowPreparedRay prepared) {
    vec3 size = abs(ray.direction);
    uint major = size.z >= size.x && size.z >= size.y ? 2u : size.y >= size.x ? 1u : 0u;
    vec3 direction = hedgerow_permuted(ray.direction, major);
    float greatest = abs(direction.z);
    float scale = hedgerow_reciprocal(direction.z);
    float flattest = uintBitsToFloat((127u - 26u) << 23) * greatest;
    vec3 coordinates = abs(ray.origin);
    precise float margin = uintBitsToFloat((127u - 22u) << 23) * max(max(coordinates.x, coordinates.y), coordinates.z) +
                           uintBitsToFloat((127u - 120u) << 23);
    // The sign is taken from the bits: −0 counts.
    vec3 steep = uintBitsToFloat(floatBitsToUint(ray.direction) & 0x80000000u | floatBitsToUint(flattest));

    prepared.origin = ray.origin;
    prepared.t_min = ray.t_min;
    prepared.t_max = ray.t_max;
    prepared.major = major;
    precise vec2 shear = direction.xy * scale;
    prepared.shear = vec3(shear, scale);
    vec3 inclined = mix(ray.direction, steep, lessThan(size, vec3(flattest)));
    prepared.inverse = vec3(hedgerow_reciprocal(inclined.x), hedgerow_reciprocal(inclined.y), hedgerow_reciprocal(inclined.z));
    prepared.slack = HEDGEROW_SLACK;
    prepared.margin = margin;
    return hedgerow_finite(ray.origin) && hedgerow_finite(ray.direction) &&
           greatest >= uintBitsToFloat((127u - 100u) << 23) && greatest <= uintBitsToFloat((127u + 100u) << 23) &&
           ray.t_min <= ray.t_max;
}
#endif
