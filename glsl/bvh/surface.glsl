// The area of a triangle inside of a box, without a list of corners.
//
// The triangle is seen along the axis that its normal is closest to; x and y are the two axes across, z that axis. What of it lies
// between two heights z is a polygon of at most five edges: what is left of its own three, and two cuts. The area of a polygon
// inside a rectangle is the sum over its edges of ∫ (clamp(y) − y of the lower side) dx, each edge from left to right counted
// positive (Green's theorem), and the area in space is a factor of that, the same for the whole triangle.
#ifndef HEDGEROW_BVH_SURFACE
#define HEDGEROW_BVH_SURFACE

struct Surface {
    uint axis;       // of z
    vec3 origin;     // what coordinates are relative to: the lowest corner
    vec3 b, c;       // the other corners, z ascending; the lowest is 0
    vec3 lo, hi;     // the box around it
    float stretch;   // area in space over area seen
    float area;
};

vec3 seen_along(uint axis, vec3 v) {
    return axis == 0 ? v.yzx : axis == 1 ? v.zxy : v;
}

Surface surface_of(vec3 v0, vec3 v1, vec3 v2) {
    vec3 normal = cross(v1 - v0, v2 - v0);
    vec3 size = abs(normal);
    uint axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    vec3 a = seen_along(axis, v0), b = seen_along(axis, v1), c = seen_along(axis, v2), t;
    if (b.z < a.z) { t = a; a = b; b = t; }
    if (c.z < b.z) { t = b; b = c; c = t; }
    if (b.z < a.z) { t = a; a = b; b = t; }
    Surface s;
    s.axis = axis;
    s.origin = a;
    s.b = b - a;
    s.c = c - a;
    s.lo = min(vec3(0.0), min(s.b, s.c));
    s.hi = max(vec3(0.0), max(s.b, s.c));
    float seen = size[axis];
    s.stretch = seen > 0.0 ? length(normal / seen) : 0.0;
    s.area = 0.5 * seen * s.stretch;
    return s;
}

// The part of the box around the triangle that lies in a box, in the triangle's coordinates; whether it can hold any area.
bool common_box(Surface s, vec3 box_lo, vec3 box_hi, out vec3 lo, out vec3 hi) {
    lo = max(seen_along(s.axis, box_lo) - s.origin, s.lo);
    hi = min(seen_along(s.axis, box_hi) - s.origin, s.hi);
    return lo.x < hi.x && lo.y < hi.y && lo.z <= hi.z;
}

// Mean of clamp(y, lo, hi) − lo on the way from one y to another.
float mean_above(float from, float to, float lo, float hi) {
    float low = min(from, to), high = max(from, to);
    float a = clamp(low, lo, hi), b = clamp(high, lo, hi);
    float within = (b - a) * (0.5 * (a + b) - lo);
    float above = max(high - max(low, hi), 0.0) * (hi - lo);
    return high > low ? (within + above) / (high - low) : a - lo;
}

float below_edge(vec2 p, vec2 q, vec2 lo, vec2 hi) {
    float a = clamp(p.x, lo.x, hi.x), b = clamp(q.x, lo.x, hi.x);
    float width = b - a;
    float per_x = width != 0.0 ? 1.0 / (q.x - p.x) : 0.0;
    return width * mean_above(mix(p.y, q.y, (a - p.x) * per_x), mix(p.y, q.y, (b - p.x) * per_x), lo.y, hi.y);
}

// Where the way up from p to q is at height z. A level way is passed by a floor above it, and not by a ceiling below it.
vec2 at_floor(vec3 p, vec3 q, float z) {
    float t = q.z > p.z ? clamp((z - p.z) / (q.z - p.z), 0.0, 1.0) : z > p.z ? 1.0 : 0.0;
    return mix(p.xy, q.xy, t);
}

vec2 at_ceiling(vec3 p, vec3 q, float z) {
    float t = q.z > p.z ? clamp((z - p.z) / (q.z - p.z), 0.0, 1.0) : z < p.z ? 0.0 : 1.0;
    return mix(p.xy, q.xy, t);
}

// The area inside of what common_box gave.
float area_inside(Surface s, vec3 lo, vec3 hi) {
    const vec3 a = vec3(0.0);
    vec2 ab0 = at_floor(a, s.b, lo.z), ab1 = at_ceiling(a, s.b, hi.z);
    vec2 bc0 = at_floor(s.b, s.c, lo.z), bc1 = at_ceiling(s.b, s.c, hi.z);
    vec2 ac0 = at_floor(a, s.c, lo.z), ac1 = at_ceiling(a, s.c, hi.z);
    vec2 cut0 = lo.z <= s.b.z ? ab0 : bc0, cut1 = hi.z >= s.b.z ? bc1 : ab1;
    float sum = below_edge(ab0, ab1, lo.xy, hi.xy) + below_edge(bc0, bc1, lo.xy, hi.xy)
              + below_edge(cut1, ac1, lo.xy, hi.xy) - below_edge(ac0, ac1, lo.xy, hi.xy)
              + below_edge(ac0, cut0, lo.xy, hi.xy);
    // The winding of the corners gives the sign: the other sign is rounding.
    bool over = s.b.x * s.c.y < s.b.y * s.c.x;
    return max(over ? sum : -sum, 0.0) * s.stretch;
}
#endif
