// Morton codes and extended Morton codes (Vinkler, Bittner, Havran 2017): src/bvh/codes explains them and is the twin.
//
// A code's sequence of axes has at most three stretches: bits of the longest axis alone, then two axes in turn, then three.
// (Halving keeps the order of the extents, so the axis that is next stays next until a third is as long.) So a code is a
// shift, two 2-way and three 3-way interleavings, whatever the bounds; `find_stretches` finds the stretches.
//
// Bit-exact on every device: coordinates are integers from the start (a float's bits, shifted), so that nothing is lost in the
// subtraction from a far corner and an object in the middle of the scene lies in the middle of the code; what is left of float
// arithmetic is +, −, · (correctly rounded by Vulkan's rules, `precise` against contraction).
#ifndef HEDGEROW_BVH_CODES
#define HEDGEROW_BVH_CODES
#include "gpu/pass.glsl"
#include "bvh/geometry.glsl"
#include "bvh/codes/axes.glsl"
#include "gpu/whole.glsl"

// What comes before the bits of the recipe: `Prefix` in src/bvh/codes/plan.rs. Kernels without have none of its code.
layout(constant_id = 6) const uint CODE_PREFIX_WORD = 0;
const uint CODE_PREFIX = CODE_PREFIX_WORD & 3u;
// Whether bits of the size are of extents, not of the diagonal: kernels by diagonals have no code for that either.
const bool BY_EXTENTS = (CODE_PREFIX_WORD & 4u) != 0;
const uint PREFIX_NONE = 0;
const uint PREFIX_SECTIONS = 1;
const uint PREFIX_CELLS = 2;
const uint PREFIX_SPLITS = 3;
const bool HAS_GRID = CODE_PREFIX >= PREFIX_CELLS;

const uint ORDER_REGULAR = 0;
const uint ORDER_SORTED = 1;
const uint ORDER_VARIABLE = 2;

// From how many times its cell's length on a primitive is large: src/bvh/codes/size.rs.
const float BEYOND = 1.5;
// The bits of the least float that is not denormal.
const int MIN_NORMAL = 1 << 23;

// Bits of the grid of binning.
const uint BINNING_BITS = 7;

// For what is huge and what is far.
const uint SECTION_BITS = 2;

// What codes are normalised by: CodeBounds in src/bvh/codes/bounds.rs.
const uint BOUNDS_FULL = 0;
const uint BOUNDS_CONCISE = 1;
const uint BOUNDS_CENTROID = 2;
const uint BOUNDS_ROBUST = 3;

// What to encode: Codes in src/bvh/codes, as the shaders take it.
struct CodeKind {
    uint order;
    uint bits;         // of the code
    uint size_group;   // coordinate bits before each bit of the size; 0: no size
    uint bounds;
    uint depth;        // mipping: layers of 8:1; binning: half the depth of the splits
    uint count_bits;   // binning: bits of a count
    uint stretch;      // binning: 1 / the weight of the stretch factor
};

// Stretch 0 is one axis alone, 1 two in turn, 2 three in turn; per axis, how many bits it has in a stretch, and at which bit of
// the code the lowest of them lies.
struct Stretches {
    uvec3 bits[3];
    uvec3 low[3];
};

// Along each axis, what is beyond the core: Sections in src/bvh/codes/sections.rs.
struct CodeSections {
    Box fences;
    Box core;
    uint head;         // coordinate bits before the one of what is far, or HEAD_APART; 0: the scene has one section
    uint beyond;       // the axes along which there is something, a bit each
    uvec3 reference;
    uvec3 shift;
};

// The cells of a grid.
struct CodeGrid {
    uint axes;         // mipping: axis of each bit of the cell from the top, two bits each from the bottom
    uvec3 bits;        // of each axis
    uvec3 shift;       // binning: bit of the cell number at which each axis begins
    ivec3 extents;     // of a cell, as the integers that compare and halve exactly
};

// The recipe for given bounds.
struct CodePlan {
    Axis axes[3];
    float size_prescale;
    float size_reciprocal;
    ivec3 size_least;  // along each axis the length from which on a primitive is too large for all of the bounds, as a float's bits; 0: flat
    float area_scale;
    Stretches stretches;
    CodeSections sections;
    CodeGrid grid;
    ivec3 typical;     // half of the extents that primitives would have if they were spread evenly (bvh/codes/sections.glsl)
    uint bits;         // of codes whose bits are chosen by spread
};

// ---- exact arithmetic ----

// The power of two that brings `magnitude` into [1/4, 1/2).
float prescale_of(float magnitude) {
    int exponent = int(floatBitsToUint(magnitude) >> 23 & 0xFFu);
    return uintBitsToFloat(uint(clamp(127 + 127 - 2 - exponent, 1, 254)) << 23);
}

// 1 / x, correctly rounded, for normal x > 0 with a normal reciprocal; 0 for anything else. Vulkan lets a device's own
// division err by 2.5 ulp, and then trees would differ between devices.
float reciprocal_or_zero(float x) {
    uint bits = floatBitsToUint(x);
    int exponent = int(bits >> 23);
    if (exponent < 1 || exponent > 252) return 0.0;
    uint mantissa = bits & 0x7FFFFFu | 0x800000u;
    if (mantissa == 0x800000u) return uintBitsToFloat(uint(254 - exponent) << 23);
    // Long division of 2^47 by the mantissa: 24 bits of quotient, the first is the leading one.
    uint quotient = 0;
    uint remainder = 0x800000u;   // 2^23, to be doubled 24 times
    for (int i = 0; i < 24; ++i) {
        remainder <<= 1;
        quotient <<= 1;
        if (remainder >= mantissa) {
            remainder -= mantissa;
            quotient |= 1;
        }
    }
    // A tie would need a mantissa that divides a power of two: there is none left.
    if (2 * remainder >= mantissa) quotient += 1;
    // 2^(exponent − 150) · mantissa inverted: quotient · 2^(103 − exponent), with the quotient in (2^23, 2^24].
    uint carry = quotient >> 24;
    return uintBitsToFloat((uint(253 - exponent) + carry) << 23 | (carry != 0 ? 0 : quotient & 0x7FFFFFu));
}

// The largest integer whose square is at most x.
uint integer_root(uint x) {
    uint root = min(whole(sqrt(float(x))), 65535u);
    // The device's root errs by a few ulp: at most one step either way, two to be safe.
    for (int i = 0; i < 2; ++i) {
        if (root * root > x) root -= 1;
    }
    for (int i = 0; i < 2; ++i) {
        if (root < 65535u && (root + 1) * (root + 1) <= x) root += 1;
    }
    return root;
}

// ---- the plan ----

Box code_bounds(Box boxes, Box centroids, uint bounds) {
    if (bounds == BOUNDS_CENTROID) return centroids;
    if (bounds != BOUNDS_CONCISE) return boxes;
    // Riemersma 2024, equation 15.
    precise vec3 difference = max(min(centroids.lo - boxes.lo, boxes.hi - centroids.hi), vec3(0));
    precise vec3 lo = boxes.lo + difference;
    precise vec3 hi = boxes.hi - difference;
    return Box(lo, hi);
}

// Half of the longest edge.
float half_extent_of(Box b) {
    precise vec3 half_extent = 0.5 * b.hi - 0.5 * b.lo;
    return max(max(half_extent.x, max(half_extent.y, half_extent.z)), 0.0);
}

// By what lengths are scaled before areas are taken, where most of the scene is in a part of it: src/bvh/sah.rs, area_scale_for.
float area_scale_for(Box scene, Box part) {
    vec3 corner = max(abs(scene.lo), abs(scene.hi));
    float farthest = max(corner.x, max(corner.y, corner.z));
    ivec3 exponent = ivec3(floatBitsToUint(vec3(half_extent_of(scene), half_extent_of(part), farthest)) >> 23 & 0xFFu);
    int scale = min(254 - exponent.y, 254 - exponent.x + 40);
    return uintBitsToFloat(uint(min(clamp(scale, 1, 254), 3 * 127 - 1 - exponent.z)) << 23);
}

float area_scale_of(Box scene) {
    return area_scale_for(scene, scene);
}

// x before y before z where equal.
uint longest_axis(ivec3 keys) {
    uint xy = keys.y > keys.x ? 1 : 0;
    return keys.z > keys[xy] ? 2 : xy;
}

uint coordinate_bits(CodeKind kind) {
    return kind.size_group == 0 ? kind.bits : kind.bits - kind.bits / (kind.size_group + 1);
}

// Extents as integers: halving is taking one from the exponent; of what is flat there is room for a code's bits below the others.
ivec3 extents_of(Box bounds) {
    precise vec3 half_extent = 0.5 * bounds.hi - 0.5 * bounds.lo;
    return mix(ivec3(-0x40000000), floatBitsToInt(half_extent), greaterThan(half_extent, vec3(0)));
}

// The axes, longest first; x before y before z where equal.
uvec3 sorted_axes(ivec3 extents) {
    uint first = longest_axis(extents);
    extents[first] = -0x7FFFFFFF;
    uint second = longest_axis(extents);
    return uvec3(first, second, 3 - first - second);
}

// As many bits, in eights, as make the same number of cells smaller than typical extents as the codes' own would if the primitives filled
// the bounds: src/bvh/codes/spread.rs.
uint bits_by_spread(CodeKind kind, ivec3 extents, ivec3 typical, bool has_core, uint most) {
    uint needed = coordinate_bits(kind), lost = has_core ? SECTION_BITS : 0, taken = 0, counted = 0;
    CodeKind longest = kind;
    longest.bits = most;
    uint total = coordinate_bits(longest);
    uvec3 sorted = kind.order == ORDER_SORTED ? sorted_axes(extents) : uvec3(0, 1, 2);
    for (; taken < total && counted < needed; ++taken) {
        uint axis = kind.order == ORDER_VARIABLE ? longest_axis(extents) : sorted[taken % 3];
        extents[axis] -= 1 << 23;
        counted += extents[axis] < typical[axis] ? 1 : 0;
    }
    CodeKind found = kind;
    while (found.bits < most && coordinate_bits(found) < taken + lost) found.bits += 8;
    return min(found.bits, most);
}

// The stretches of `total` coordinate bits.
Stretches find_stretches(uint order, ivec3 extents, uint total) {
    Stretches found;
    for (uint stretch = 0; stretch < 3; ++stretch) {
        found.bits[stretch] = uvec3(0);
        found.low[stretch] = uvec3(0);
    }
    uvec3 sorted = order == ORDER_SORTED ? sorted_axes(extents) : uvec3(0, 1, 2);
    uint seen = 0;   // axes so far, a bit each
    for (uint taken = 0; taken < total; ++taken) {
        uint axis = order == ORDER_VARIABLE ? longest_axis(extents) : sorted[taken % 3];
        extents[axis] -= 1 << 23;
        seen |= 1 << axis;
        uint stretch = order == ORDER_VARIABLE ? bitCount(seen) - 1 : 2;
        found.bits[stretch][axis] += 1;
        found.low[stretch][axis] = total - 1 - taken;
    }
    return found;
}

// All but the axes, the sections and the scale of areas.
CodePlan plan_codes(CodeKind kind, Box bounds) {
    CodePlan plan;
    vec3 magnitude = max(abs(bounds.lo), abs(bounds.hi));
    plan.size_prescale = prescale_of(max(magnitude.x, max(magnitude.y, magnitude.z)));
    precise vec3 e = bounds.hi * plan.size_prescale - bounds.lo * plan.size_prescale;
    precise float diagonal2 = e.x * e.x + e.y * e.y + e.z * e.z;
    plan.size_reciprocal = reciprocal_or_zero(diagonal2);
    if (BY_EXTENTS) {
        precise vec3 least = BEYOND * e;
        plan.size_least = mix(ivec3(0), floatBitsToInt(least), greaterThanEqual(floatBitsToInt(least), ivec3(MIN_NORMAL)));
    }
    ivec3 extents = extents_of(bounds);
    if (HAS_GRID) {
        plan.grid.bits = uvec3(0);
        plan.grid.axes = 0;
        uvec3 sorted = sorted_axes(extents);
        uint grid_bits = CODE_PREFIX == PREFIX_CELLS ? 3 * kind.depth : BINNING_BITS;
        for (uint bit = 0; bit < grid_bits; ++bit) {
            uint axis = longest_axis(extents);
            extents[axis] -= 1 << 23;
            plan.grid.bits[axis] += 1;
            plan.grid.axes |= axis << 2 * bit;
        }
        plan.grid.shift[sorted.x] = 0;
        plan.grid.shift[sorted.y] = plan.grid.bits[sorted.x];
        plan.grid.shift[sorted.z] = plan.grid.bits[sorted.x] + plan.grid.bits[sorted.y];
        plan.grid.extents = extents;
    }
    plan.stretches = find_stretches(kind.order, extents, coordinate_bits(kind));
    return plan;
}

// ---- encoding ----

// Bits 0 … 15 to the even places.
uint spread_by_2(uint x) {
    x = (x | x << 8) & 0x00FF00FFu;
    x = (x | x << 4) & 0x0F0F0F0Fu;
    x = (x | x << 2) & 0x33333333u;
    return (x | x << 1) & 0x55555555u;
}

// Bits 0 … 10 to every third place.
uint spread_by_3(uint x) {
    x = (x | x << 16) & 0x070000FFu;
    x = (x | x << 8) & 0x0700F00Fu;
    x = (x | x << 4) & 0x430C30C3u;
    return (x | x << 2) & 0x49249249u;
}

// The code bits of one axis with coordinate q.
uvec2 axis_bits(Stretches s, uint axis, uvec2 q) {
    uint alone = s.bits[0][axis], paired = s.bits[1][axis], tripled = s.bits[2][axis];
    uint three = bits_of(q, alone + paired, tripled).x;
    uvec2 code = shift_left(uvec2(spread_by_3(three & 0x7FFu), spread_by_3(three >> 11) << 1), s.low[2][axis]);
    if (alone + paired > 0) {
        uint two = bits_of(q, alone, paired).x;
        code |= shift_left(uvec2(spread_by_2(two & 0xFFFFu), spread_by_2(two >> 16)), s.low[1][axis]);
        code |= shift_left(bits_of(q, 0, alone), s.low[0][axis]);
    }
    return code;
}

// Diagonal of the box over that of the scene, as a 16-bit fraction.
uint size_of(CodePlan plan, Box b) {
    precise vec3 e = b.hi * plan.size_prescale - b.lo * plan.size_prescale;
    precise float squared = (e.x * e.x + e.y * e.y + e.z * e.z) * plan.size_reciprocal;
    if (squared >= 1.0) return 65535u;
    precise float fixed_point = squared * 4294967296.0;
    return integer_root(long_whole(fixed_point));
}

// How many coordinate bits there are up to the one that halves an axis for the `halvings`th time; many where none does.
uint bits_until(Stretches s, uint axis, uint halvings, uint total) {
    uint until = halvings == 0 ? 0 : 0x7FFFFFFFu;
    uint before = 0;
    for (uint stretch = 0; stretch < 3; ++stretch) {
        uint to = before + s.bits[stretch][axis];
        if (halvings > before && halvings <= to) until = total - s.low[stretch][axis] - (to - halvings) * (stretch + 1);
        before = to;
    }
    return until;
}

// The bits of a size by extents: ones from the first on before which some axis' cell is too short. src/bvh/codes/size.rs explains it.
uint size_by_extents(CodeKind kind, CodePlan plan, Box b) {
    precise vec3 e = b.hi * plan.size_prescale - b.lo * plan.size_prescale;
    ivec3 length = floatBitsToInt(e);
    uint bits = 0x7FFFFFFFu;
    for (uint axis = 0; axis < 3; ++axis) {
        if (length[axis] < MIN_NORMAL || plan.size_least[axis] == 0) continue;
        uint halvings = uint(max(plan.size_least[axis] - length[axis] + 0x7FFFFF >> 23, 0));
        bits = min(bits, bits_until(plan.stretches, axis, halvings, coordinate_bits(kind)));
    }
    // The bit of the size that stands behind the group in which that one is.
    return 0xFFFFu >> min((max(bits, 1) - 1) / kind.size_group, 16u);
}

// One bit of the size behind each group of coordinate bits.
uvec2 with_size(CodeKind kind, uvec2 coordinates, uint size) {
    uint left = coordinate_bits(kind);
    uint group = kind.size_group;
    uvec2 code = uvec2(0);
    for (uint k = 0; k < 16 && left > 0; ++k) {
        uint take = min(group, left);
        left -= take;
        code = shift_left(code, take);
        code.x |= shift_right(coordinates, left).x & ((1u << take) - 1);
        if (take == group && (k + 1) * (group + 1) <= kind.bits) {
            code = shift_left(code, 1);
            code.x |= size >> (15 - k) & 1;
        }
    }
    return code;
}

// The code of primitives that are left out: all ones, behind all others.
uvec2 inactive_code(CodeKind kind) {
    return bits_of(uvec2(0xFFFFFFFFu), 0, kind.bits);
}

// ---- codes of at most 32 bits: the same with half the words ----

// `count` bits of `v` from bit `from` below the top, at the bottom.
uint bits_of(uint v, uint from, uint count) {
    return count == 0 ? 0 : v << from >> (32 - count);
}

uint narrow_axis_bits(Stretches s, uint axis, uint q) {
    uint alone = s.bits[0][axis], paired = s.bits[1][axis], tripled = s.bits[2][axis];
    uint code = spread_by_3(bits_of(q, alone + paired, tripled)) << s.low[2][axis];
    code |= spread_by_2(bits_of(q, alone, paired)) << s.low[1][axis];
    return code | bits_of(q, 0, alone) << s.low[0][axis];
}

uint narrow_with_size(CodeKind kind, uint coordinates, uint size) {
    uint left = coordinate_bits(kind);
    uint group = kind.size_group;
    uint code = 0;
    for (uint k = 0; k < 8 && left > 0; ++k) {
        uint take = min(group, left);
        left -= take;
        code = code << take | coordinates >> left & ((1u << take) - 1);
        if (take == group && (k + 1) * (group + 1) <= kind.bits) code = code << 1 | size >> (15 - k) & 1;
    }
    return code;
}

// ---- a primitive's code ----

// What a code is made of.
struct CodeParts {
    uvec2 coordinates[3];
    Stretches stretches;
    uint size;
    uint prefix;
    uint prefix_bits;
    uint section;
};

// The parts of a code without a prefix.
CodeParts plain_parts(CodeKind kind, CodePlan plan, Box b) {
    vec3 at = centroid_of(b);
    CodeParts parts;
    for (uint axis = 0; axis < 3; ++axis) parts.coordinates[axis] = fraction_of(at[axis], plan.axes[axis]);
    parts.stretches = plan.stretches;
    parts.size = 0;
    if (kind.size_group != 0) parts.size = BY_EXTENTS ? size_by_extents(kind, plan, b) : size_of(plan, b);
    parts.prefix = 0;
    parts.prefix_bits = 0;
    parts.section = 0;
    return parts;
}

uint narrow_body(CodeKind kind, CodeParts parts) {
    uint code = 0;
    for (uint axis = 0; axis < 3; ++axis) code |= narrow_axis_bits(parts.stretches, axis, parts.coordinates[axis].y);
    return kind.size_group != 0 ? narrow_with_size(kind, code, parts.size) : code;
}

uvec2 wide_body(CodeKind kind, CodeParts parts) {
    uvec2 code = uvec2(0);
    for (uint axis = 0; axis < 3; ++axis) code |= axis_bits(parts.stretches, axis, parts.coordinates[axis]);
    return kind.size_group != 0 ? with_size(kind, code, parts.size) : code;
}
#endif
