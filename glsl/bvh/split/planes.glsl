// Planes that triangles are split at, and the boxes of what lies on their two sides: src/bvh/twin/split.rs is the twin, bit for
// bit, and says why no part of a triangle is lost.
#ifndef HEDGEROW_BVH_SPLIT_PLANES
#define HEDGEROW_BVH_SPLIT_PLANES
#include "bvh/codes.glsl"
#include "bvh/references.glsl"

// Halvings of the scene's extent.
const uint SPLIT_LEVELS = 20;
const float CELLS = 1048576.0;
// Biased exponents of the longest extents of scenes that are split: 2^-40 to 2^120.
const uint LEAST_EXPONENT = 127 - 40;
const uint MOST_EXPONENT = 127 + 120;

// 2^exponent.
float power_of_two(int exponent) {
    return uintBitsToFloat(uint(127 + exponent) << 23);
}

uint biased_exponent_of(float x) {
    return floatBitsToUint(x) >> 23 & 0xFFu;
}

SplitGrid grid_over(Box scene) {
    SplitGrid grid = SplitGrid(scene.lo, vec3(0), vec3(0), uvec3(0), 0.0);
    precise vec3 extent = scene.hi - scene.lo;
    uint longest = biased_exponent_of(max(extent.x, max(extent.y, extent.z)));
    if (longest < LEAST_EXPONENT || longest > MOST_EXPONENT) return grid;
    grid.scale = uintBitsToFloat((253u - longest) << 23);
    for (uint axis = 0; axis < 3; ++axis) {
        uint own = biased_exponent_of(extent[axis]);
        if (own + SPLIT_LEVELS >= longest) {
            grid.level[axis] = longest - own;
            grid.cell[axis] = extent[axis] * power_of_two(-int(SPLIT_LEVELS));
            grid.cells_per_length[axis] = reciprocal_or_zero(extent[axis]) * CELLS;
        }
    }
    return grid;
}

// What is nearer to zero than that is zero, so that no result is too small for the device to keep.
float without_tiny(float x) {
    return abs(x) < power_of_two(-100) ? 0.0 : x;
}

struct SplitPlane {
    uint axis;
    float at;
    uint level;   // halvings of the scene's longest extent that the plane's spacing is, less one
};

// The most important plane of the grid that lies strictly inside of a box: that of the greatest spacing; of such ones, across the
// longer side of the box. False if there is none.
bool find_plane(SplitGrid grid, Box b, out SplitPlane plane) {
    plane = SplitPlane(0, 0.0, NO_PRIMITIVE);
    float longest = 0.0;
    for (uint axis = 0; axis < 3; ++axis) {
        if (grid.cell[axis] == 0.0) continue;
        precise float from_lo = (b.lo[axis] - grid.lo[axis]) * grid.cells_per_length[axis];
        precise float to_hi = (b.hi[axis] - grid.lo[axis]) * grid.cells_per_length[axis];
        precise float side = b.hi[axis] - b.lo[axis];
        uint from = whole(clamp(from_lo, 0.0, CELLS - 1.0)), to = whole(clamp(to_hi, 0.0, CELLS - 1.0));
        // Rounding may put a side of the box a cell too far, no more.
        for (uint attempt = 0; attempt < 4 && from < to; ++attempt) {
            uint bit = uint(findMSB(from ^ to));
            uint index = to >> bit << bit;
            precise float place = grid.lo[axis] + float(index) * grid.cell[axis];
            float at = without_tiny(place);
            if (at <= b.lo[axis]) {
                from = index;
            } else if (at >= b.hi[axis]) {
                to = index - 1;
            } else {
                uint level = SPLIT_LEVELS - 1 - bit + grid.level[axis];
                if (level < plane.level || level == plane.level && side > longest) {
                    plane = SplitPlane(axis, at, level);
                    longest = side;
                }
                break;
            }
        }
    }
    return plane.level != NO_PRIMITIVE;
}

Box no_box() {
    return Box(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
}

bool is_empty(Box b) {
    return any(greaterThan(b.lo, b.hi));
}

// A box around where an edge from below a plane to above it crosses.
Box crossing_of(vec3 a, vec3 b, SplitPlane plane) {
    const float SHORTEST = power_of_two(-60);
    precise vec3 d = b - a;
    Box crossing = Box(min(a, b), max(a, b));
    float along = d[plane.axis];
    if (along >= SHORTEST) {
        precise float part = (plane.at - without_tiny(a[plane.axis])) * reciprocal_or_zero(along);
        float t = part < SHORTEST ? 0.0 : part;
        for (uint k = 0; k < 3; ++k) {
            if (abs(d[k]) >= SHORTEST) {
                precise float point = without_tiny(a[k]) + t * d[k];
                precise float margin = power_of_two(-19) * abs(d[k]) + power_of_two(-22) * max(abs(a[k]), abs(b[k]));
                precise float least = point - margin;
                precise float greatest = point + margin;
                crossing.lo[k] = max(crossing.lo[k], least);
                crossing.hi[k] = min(crossing.hi[k], greatest);
            }
        }
    }
    crossing.lo[plane.axis] = plane.at;
    crossing.hi[plane.axis] = plane.at;
    return crossing;
}

void grow(inout Box b, Box other) {
    b = Box(min(b.lo, other.lo), max(b.hi, other.hi));
}

// Boxes around what of a triangle's part in a box lies on the two sides of a plane.
void split_at(Corners c, Box b, SplitPlane plane, out Box below, out Box above) {
    vec3 corners[3] = vec3[3](c.v0, c.v1, c.v2);
    below = no_box();
    above = no_box();
    for (uint k = 0; k < 3; ++k) {
        vec3 p = corners[k], q = corners[k == 2 ? 0 : k + 1];
        float from = p[plane.axis], to = q[plane.axis];
        if (from <= plane.at) grow(below, Box(p, p));
        if (from >= plane.at) grow(above, Box(p, p));
        if (min(from, to) < plane.at && plane.at < max(from, to)) {
            Box crossing = crossing_of(from < to ? p : q, from < to ? q : p, plane);
            grow(below, crossing);
            grow(above, crossing);
        }
    }
    below = Box(max(below.lo, b.lo), min(below.hi, b.hi));
    above = Box(max(above.lo, b.lo), min(above.hi, b.hi));
}

float longest_side(Box b) {
    precise vec3 extent = b.hi - b.lo;
    return max(extent.x, max(extent.y, extent.z));
}

// How many of the splits go to the part in the first box: in proportion to the longest sides, rounded.
uint splits_of_first(uint splits, Box first, Box second) {
    vec2 side = vec2(longest_side(first), longest_side(second));
    float longest = max(side.x, side.y);
    if (longest < power_of_two(-100)) return splits / 2;
    // Fifteen bits of the longer one.
    precise vec2 scaled = side * uintBitsToFloat((268u - biased_exponent_of(longest)) << 23);
    uvec2 parts = uvec2(scaled);
    uint sum = parts.x + parts.y;
    return (2 * splits * parts.x + sum) / (2 * sum);
}

// The box of a part, larger by the slack that its triangle's vertices need.
Box padded(Box b, Box whole) {
    precise vec3 lo = b.lo - (power_of_two(-18) * longest_side(whole) + power_of_two(-22) * abs(b.lo));
    precise vec3 hi = b.hi + (power_of_two(-18) * longest_side(whole) + power_of_two(-22) * abs(b.hi));
    return Box(lo, hi);
}

// The part of a triangle by number: it has one part more than splits. False if there is no such part.
bool find_part(SplitGrid grid, Corners c, uint splits, uint number, out Box b) {
    Box whole = box_around(c);
    b = whole;
    // No box has more planes inside: each level has one along each axis.
    for (uint depth = 0; depth < 3 * SPLIT_LEVELS && splits > 0; ++depth) {
        SplitPlane plane;
        if (!find_plane(grid, b, plane)) break;
        Box below, above;
        split_at(c, b, plane, below, above);
        splits -= 1;
        if (is_empty(below) || is_empty(above)) {
            b = is_empty(below) ? above : below;
            continue;
        }
        uint first = splits_of_first(splits, below, above);
        if (number <= first) {
            b = below;
            splits = first;
        } else {
            b = above;
            number -= first + 1;
            splits -= first;
        }
    }
    if (b != whole) b = padded(b, whole);
    return number == 0;
}
#endif
