// A ray made ready for the tests, computed once: the twin of src/trace/ray.rs, which says why.
#ifndef HEDGEROW_TRACE_RAY
#define HEDGEROW_TRACE_RAY

#define HEDGEROW_INFINITY uintBitsToFloat(0x7f800000u)
const uint HEDGEROW_NONE = 0xffffffffu;

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
    float reach;
    vec3 inverse;
    vec3 origin_lo;
    vec3 origin_hi;
};

bool hedgerow_finite(vec3 x) {
    return all(notEqual(floatBitsToUint(x) & 0x7f800000u, uvec3(0x7f800000u)));
}

// The components of v with the major axis last and the two that follow it before.
vec3 hedgerow_permuted(vec3 v, uint major) {
    return major == 2u ? v : major == 1u ? v.zxy : v.yzx;
}

// Whether the ray can hit anything at all, and what the tests need of it in a scene inside lo..hi.
bool hedgerow_prepare(HedgerowRay ray, vec3 lo, vec3 hi, out HedgerowPreparedRay prepared) {
    vec3 size = abs(ray.direction);
    uint major = size.z >= size.x && size.z >= size.y ? 2u : size.y >= size.x ? 1u : 0u;
    precise vec3 extent = max(abs(lo - ray.origin), abs(hi - ray.origin));
    vec3 direction = hedgerow_permuted(ray.direction, major);
    float greatest = abs(direction.z);
    precise float scale = 1.0 / direction.z;
    float flattest = uintBitsToFloat((127u - 26u) << 23) * greatest;
    float reach = hedgerow_permuted(extent, major).z;
    precise vec3 slack = uintBitsToFloat((127u - 19u) << 23) * (extent + reach) +
                         uintBitsToFloat((127u - 22u) << 23) * abs(ray.origin);
    // The sign is taken from the bits: −0 counts.
    vec3 steep = uintBitsToFloat(floatBitsToUint(ray.direction) & 0x80000000u | floatBitsToUint(flattest));

    prepared.origin = ray.origin;
    prepared.t_min = ray.t_min;
    prepared.t_max = ray.t_max;
    prepared.major = major;
    precise vec2 shear = direction.xy * scale;
    prepared.shear = vec3(shear, scale);
    prepared.reach = reach;
    prepared.inverse = 1.0 / mix(ray.direction, steep, lessThan(size, vec3(flattest)));
    precise vec3 origin_lo = ray.origin + slack;
    precise vec3 origin_hi = ray.origin - slack;
    prepared.origin_lo = origin_lo;
    prepared.origin_hi = origin_hi;
    return hedgerow_finite(ray.origin) && hedgerow_finite(ray.direction) &&
           greatest >= uintBitsToFloat((127u - 100u) << 23) && greatest <= uintBitsToFloat((127u + 100u) << 23) &&
           ray.t_min <= ray.t_max;
}
#endif
