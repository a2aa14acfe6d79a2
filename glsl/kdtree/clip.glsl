// Split clipping: the box of what of a triangle lies in a cell. src/kdtree/host/clip.rs is the twin, bit for bit, and says why no
// point of a triangle is lost.
#ifndef HEDGEROW_KDTREE_CLIP
#define HEDGEROW_KDTREE_CLIP
#include "kdtree/builder.glsl"
#include "gpu/reciprocal.glsl"
#include "bvh/codes.glsl"

const float OF_SIDE = 3.814697265625e-6;                  // 2^-18
const float OF_COORDINATE = 4.76837158203125e-7;          // 2^-21
const float TWICE_SLACK = 7.62939453125e-6;               // 2^-17
const float FARTHEST = 3.4028234663852886e38;
const uint POLYGON_CORNERS = 9;

float least_rounding() {
    return uintBitsToFloat((127u - 120u) << 23);
}

float shortest_edge() {
    return uintBitsToFloat((127u - 100u) << 23);
}

float longest_edge() {
    return uintBitsToFloat((127u + 125u) << 23);
}

float least_normal() {
    return uintBitsToFloat(1u << 23);
}

float longest_side(Box b) {
    precise vec3 extent = b.hi - b.lo;
    return min(max(max(0.0, extent.x), max(extent.y, extent.z)), FARTHEST);
}

// By how much along each axis the box of a part is off at most.
vec3 rounding_of(Box whole, float longest) {
    precise vec3 rounding = OF_SIDE * longest + OF_COORDINATE * max(abs(whole.lo), abs(whole.hi)) + least_rounding();
    return rounding;
}

// How near along each axis is near enough to be met for a triangle: nothing for those within `reach`.
vec3 room_of(float longest, vec3 rounding, float reach) {
    precise vec3 room = TWICE_SLACK * longest + rounding;
    return longest > reach ? room : vec3(0.0);
}

Box widened(Box b, vec3 by) {
    precise vec3 lo = b.lo - by;
    precise vec3 hi = b.hi + by;
    return Box(lo, hi);
}

Box common_part(Box a, Box b) {
    return Box(max(a.lo, b.lo), min(a.hi, b.hi));
}

Box finite_part(Box b) {
    return Box(max(b.lo, vec3(-FARTHEST)), min(b.hi, vec3(FARTHEST)));
}

// The box of a triangle with its room.
Box bounds_of(Corners c, float reach) {
    Box whole = box_around(c);
    float longest = longest_side(whole);
    return finite_part(widened(whole, room_of(longest, rounding_of(whole, longest), reach)));
}

// What a triangle adds to the root's cell.
Box cell_around(Corners c, float reach) {
    Box whole = box_around(c);
    return finite_part(widened(bounds_of(c, reach), rounding_of(whole, longest_side(whole))));
}

// Where the edge from a to b, which goes up along the axis, crosses the plane, within the box around it; `outer` where it is too
// short or too long to tell.
vec3 crossing_of(vec3 a, vec3 b, uint axis, float plane, vec3 outer) {
    precise vec3 d = b - a;
    if (d[axis] < shortest_edge() || d[axis] > longest_edge() || !is_finite(d)) return outer;
    precise float t = (plane - a[axis]) * hedgerow_reciprocal(d[axis]);
    if (t < least_normal()) t = 0.0;
    precise vec3 point = a + t * d;
    point = min(max(point, min(a, b)), max(a, b));
    point[axis] = plane;
    return point;
}

// The faces of a cell beyond which a box reaches: two bits an axis, the upper face first.
uint faces_beyond(Box b, Box cell) {
    bvec3 above = greaterThan(b.hi, cell.hi), below = lessThan(b.lo, cell.lo);
    uint faces = 0;
    for (uint axis = 0; axis < 3; ++axis) faces |= (above[axis] ? 1u : 0u) << 2u * axis | (below[axis] ? 2u : 0u) << 2u * axis;
    return faces;
}

// The box of a triangle's part in a cell; false if no part is in it.
bool clip_triangle(Corners c, float reach, Box cell, out Box part) {
    Box whole = box_around(c);
    float longest = longest_side(whole);
    vec3 rounding = rounding_of(whole, longest), room = room_of(longest, rounding, reach);
    precise vec3 margin = room + rounding;
    Box larger = widened(cell, margin);
    // The polygon and what becomes of it at a face, in turn.
    vec3 polygon[2 * POLYGON_CORNERS];
    polygon[0] = c.v0;
    polygon[1] = c.v1;
    polygon[2] = c.v2;
    uint from = 0, count = 3;
    uint faces = faces_beyond(whole, larger);
    if (faces != 0u) do {
        uint face = findLSB(faces), axis = face >> 1, to = POLYGON_CORNERS - from, kept = 0;
        bool is_upper = (face & 1u) == 0u;
        float plane = is_upper ? larger.hi[axis] : larger.lo[axis];
        vec3 p = polygon[from];
        bool keeps_p = is_upper ? p[axis] <= plane : p[axis] >= plane;
        uint i = 0;
        do {
            vec3 q = polygon[from + (i + 1 < count ? i + 1 : 0)];
            bool keeps_q = is_upper ? q[axis] <= plane : q[axis] >= plane;
            if (keeps_p) polygon[to + kept++] = p;
            if (keeps_p != keeps_q) {
                bool goes_up = p[axis] < q[axis];
                polygon[to + kept++] = crossing_of(goes_up ? p : q, goes_up ? q : p, axis, plane, keeps_p ? q : p);
            }
            p = q;
            keeps_p = keeps_q;
        } while (++i < count);
        from = to;
        count = kept;
        faces &= faces - 1u;
    } while (faces != 0u && count != 0u);
    // A polygon of no corners has a box from +∞ to −∞.
    Box bounds = Box(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
    // Not a loop that tests at its end: SwiftShader has lanes that have left such a one go on computing what is used behind it.
    for (uint i = 0; i < count; ++i) {
        vec3 p = polygon[from + i];
        bounds = Box(min(bounds.lo, p), max(bounds.hi, p));
    }
    Box own = finite_part(widened(whole, room));
    part = common_part(common_part(widened(bounds, margin), own), cell);
    return all(lessThanEqual(part.lo, part.hi));
}

// Whether a box is on the left of a plane, and on its right.
bvec2 sides_of(Box b, uint axis, float plane, bool planar_left) {
    float lo = b.lo[axis], hi = b.hi[axis];
    bool is_planar = lo == plane && hi == plane;
    return bvec2(lo < plane || is_planar && planar_left, hi > plane || is_planar && !planar_left);
}

Corners corners_of_record(uint record) {
    Triangles triangles = Triangles(kd_records_at(structure_address, node_room, reference_room));
    Triangle t = triangles.triangle[record];
    return Corners(t.v0, t.v1, t.v2);
}
#endif
