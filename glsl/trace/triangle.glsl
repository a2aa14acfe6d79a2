// The watertight triangle test (Woop, Benthin, Wald 2013): the twin of src/trace/triangle.rs, bit for bit.
#ifndef HEDGEROW_TRACE_TRIANGLE
#define HEDGEROW_TRACE_TRIANGLE
#include "trace/determinant.glsl"
#include "trace/ray.glsl"

vec3 hedgerow_sheared(HedgerowPreparedRay ray, vec3 vertex) {
    precise vec3 p = hedgerow_permuted(vertex - ray.origin, ray.major);
    precise vec2 xy = p.xy - ray.shear.xy * p.z;
    return vec3(xy, p.z);
}

// The edge functions with exact signs and 24 right bits, divided by a common power of two.
bool hedgerow_exactly(vec3 a, vec3 b, vec3 c, out vec3 edges) {
    if (!(hedgerow_finite(vec3(a.xy, b.x)) && hedgerow_finite(vec3(b.y, c.xy)))) return false;
    HedgerowScaled u = hedgerow_difference_of_products(c.x, b.y, c.y, b.x);
    HedgerowScaled v = hedgerow_difference_of_products(a.x, c.y, a.y, c.x);
    HedgerowScaled w = hedgerow_difference_of_products(b.x, a.y, b.y, a.x);
    ivec3 signs = sign(ivec3(u.mantissa, v.mantissa, w.mantissa));
    if (any(equal(signs, ivec3(1))) == any(equal(signs, ivec3(-1)))) return false;
    const int LEAST = -1000;
    int exponent = max(max(signs.x != 0 ? u.exponent : LEAST, signs.y != 0 ? v.exponent : LEAST), signs.z != 0 ? w.exponent : LEAST);
    edges = vec3(hedgerow_relative_to(u, exponent), hedgerow_relative_to(v, exponent), hedgerow_relative_to(w, exponent));
    return true;
}

// Where the ray's line meets the triangle: t and the weights of the second and third vertex.
bool hedgerow_meet(HedgerowPreparedRay ray, vec3 v0, vec3 v1, vec3 v2, out vec3 meeting) {
    const float TRUSTED = uintBitsToFloat((127u - 76u) << 23);
    const float LARGEST_CUBE = uintBitsToFloat((127u + 100u) << 23);
    vec3 a = hedgerow_sheared(ray, v0);
    vec3 b = hedgerow_sheared(ray, v1);
    vec3 c = hedgerow_sheared(ray, v2);
    precise vec3 edges = vec3(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    float least = min(min(edges.x, edges.y), edges.z);
    float greatest = max(max(edges.x, edges.y), edges.z);
    if (least < -TRUSTED && greatest > TRUSTED) return false;

    vec2 m = max(max(abs(a.xy), abs(b.xy)), abs(c.xy));
    float largest = max(m.x, m.y);
    precise float cube = largest * largest * largest;
    precise float sum = edges.x + edges.y + edges.z;
    bool trusted = least > TRUSTED || greatest < -TRUSTED;
    bool accurate = cube < LARGEST_CUBE && 4.0 * cube <= ray.reach * abs(sum);
    if (!(trusted && accurate)) {
        vec3 exact;
        if (!hedgerow_exactly(a, b, c, exact)) return false;
        edges = exact;
    }
    precise float scale = 1.0 / (edges.x + edges.y + edges.z);
    precise vec3 weights = edges * scale;
    precise float t = (weights.x * a.z + weights.y * b.z + weights.z * c.z) * ray.shear.z;
    meeting = vec3(t, weights.yz);
    return true;
}
#endif
