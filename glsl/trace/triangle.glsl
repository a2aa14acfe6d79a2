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
bool hedgerow_exactly(vec3 a, vec3 b, vec3 c, inout vec3 edges) {
    bool meets = false;
    if (hedgerow_finite(vec3(a.xy, b.x)) && hedgerow_finite(vec3(b.y, c.xy))) {
        HedgerowScaled u = hedgerow_difference_of_products(c.x, b.y, c.y, b.x);
        HedgerowScaled v = hedgerow_difference_of_products(a.x, c.y, a.y, c.x);
        HedgerowScaled w = hedgerow_difference_of_products(b.x, a.y, b.y, a.x);
        ivec3 signs = sign(ivec3(u.mantissa, v.mantissa, w.mantissa));
        meets = any(equal(signs, ivec3(1))) != any(equal(signs, ivec3(-1)));
        const int LEAST = -1000;
        int exponent =
            max(max(signs.x != 0 ? u.exponent : LEAST, signs.y != 0 ? v.exponent : LEAST), signs.z != 0 ? w.exponent : LEAST);
        edges = vec3(hedgerow_relative_to(u, exponent), hedgerow_relative_to(v, exponent), hedgerow_relative_to(w, exponent));
    }
    return meets;
}

// x · y as the rounded product and, in `rest`, what it is off by; from the leading halves of the factors and their rests.
vec3 hedgerow_product(vec3 x, vec3 x_leading, vec3 x_rest, vec3 y, vec3 y_leading, vec3 y_rest, out vec3 rest) {
    precise vec3 rounded = x * y;
    precise vec3 off = ((x_leading * y_leading - rounded) + x_leading * y_rest + x_rest * y_leading) + x_rest * y_rest;
    rest = off;
    return rounded;
}

// The edge functions off by less than 2^-44 of the greater product.
vec3 hedgerow_differences(vec3 a, vec3 b, vec3 c) {
    vec3 x = vec3(a.x, b.x, c.x), y = vec3(a.y, b.y, c.y);
    precise vec3 x_scaled = 4097.0 * x;
    precise vec3 y_scaled = 4097.0 * y;
    precise vec3 xl = x_scaled - (x_scaled - x);
    precise vec3 yl = y_scaled - (y_scaled - y);
    precise vec3 xr = x - xl;
    precise vec3 yr = y - yl;
    vec3 first_rest, second_rest;
    vec3 first = hedgerow_product(x.zxy, xl.zxy, xr.zxy, y.yzx, yl.yzx, yr.yzx, first_rest);
    vec3 second = hedgerow_product(y.zxy, yl.zxy, yr.zxy, x.yzx, xl.yzx, xr.yzx, second_rest);
    precise vec3 plain = first - second;
    precise vec3 taken = plain - first;
    precise vec3 lost = (first - (plain - taken)) - (second + taken);
    precise vec3 differences = plain + (lost + (first_rest - second_rest));
    return differences;
}

// 2^-76 and 2^100.
const float HEDGEROW_TRUSTED = 1.0 / 75557863725914323419136.0;
const float HEDGEROW_LARGEST_CUBE = 1267650600228229401496703205376.0;
const float HEDGEROW_PART_OF_CUBE = 0.5625;

// The edge functions with right signs and accurate enough, where the plain ones are not.
bool hedgerow_carefully(vec3 a, vec3 b, vec3 c, float m, float reach, out vec3 edges) {
    const float CERTAIN = uintBitsToFloat((127u - 40u) << 23);
    const float SMALLER = uintBitsToFloat((127u - 20u) << 23);
    edges = hedgerow_differences(a, b, c);
    float least = min(min(edges.x, edges.y), edges.z);
    float greatest = max(max(edges.x, edges.y), edges.z);
    float nearest = min(min(abs(edges.x), abs(edges.y)), abs(edges.z));
    precise float cube = m * m * m;
    precise float certainty = CERTAIN * (m * m);
    bool certain = nearest > certainty && nearest > HEDGEROW_TRUSTED;
    bool passes = certain && least < 0.0 && greatest > 0.0;
    precise float sum = edges.x + edges.y + edges.z;
    precise float error = SMALLER * (HEDGEROW_PART_OF_CUBE * cube);
    precise float allowed = reach * abs(sum);
    bool suffices = certain && cube < HEDGEROW_LARGEST_CUBE && error <= allowed;
    bool meets = !passes;
    if (meets && !suffices) meets = hedgerow_exactly(a, b, c, edges);
    return meets;
}

// Where the ray's line meets the triangle: t and the weights of the second and third vertex; and whether it meets the front,
// to which (v1 - v0) × (v2 - v0) points.
bool hedgerow_meet_facing(HedgerowPreparedRay ray, vec3 v0, vec3 v1, vec3 v2, out vec3 meeting, out bool is_front) {
    vec3 a = hedgerow_sheared(ray, v0);
    vec3 b = hedgerow_sheared(ray, v1);
    vec3 c = hedgerow_sheared(ray, v2);
    precise vec3 edges = vec3(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    float least = min(min(edges.x, edges.y), edges.z);
    float greatest = max(max(edges.x, edges.y), edges.z);
    // No bool: trace/query_walk.glsl says why.
    uint meets = least < -HEDGEROW_TRUSTED && greatest > HEDGEROW_TRUSTED ? 0u : 1u;
    if (meets != 0u) {
        vec2 m = max(max(abs(a.xy), abs(b.xy)), abs(c.xy));
        float largest = max(m.x, m.y);
        precise float cube = largest * largest * largest;
        precise float sum = edges.x + edges.y + edges.z;
        // Along some axis, the farthest vertex is at least this far from the origin.
        precise float reach = max(max(abs(a.z), abs(b.z)), max(abs(c.z), 0.5 * largest));
        precise float error = HEDGEROW_PART_OF_CUBE * cube;
        precise float allowed = reach * abs(sum);
        bool trusted = least > HEDGEROW_TRUSTED || greatest < -HEDGEROW_TRUSTED;
        bool accurate = cube < HEDGEROW_LARGEST_CUBE && error <= allowed;
        if (!(trusted && accurate)) {
            vec3 careful = edges;
            meets = hedgerow_carefully(a, b, c, largest, reach, careful) ? 1u : 0u;
            edges = careful;
        }
        precise float all = edges.x + edges.y + edges.z;
        float scale = hedgerow_reciprocal(all);
        precise vec3 weights = edges * scale;
        precise float t = (weights.x * a.z + weights.y * b.z + weights.z * c.z) * ray.shear.z;
        meeting = vec3(t, weights.yz);
        // The permutation keeps the sense of rotation, and the shear turns it where the ray goes down its major axis.
        is_front = (scale > 0.0) != (ray.shear.z < 0.0);
    }
    return meets != 0u;
}

bool hedgerow_meet(HedgerowPreparedRay ray, vec3 v0, vec3 v1, vec3 v2, out vec3 meeting) {
    bool is_front;
    return hedgerow_meet_facing(ray, v0, v1, v2, meeting, is_front);
}
#endif
