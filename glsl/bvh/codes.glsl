// Morton codes and extended Morton codes (Vinkler, Bittner, Havran 2017): src/bvh/codes.rs explains them and is the twin.
//
// A code's sequence of axes has at most three stretches: bits of the longest axis alone, then two axes in turn, then three.
// (Halving keeps the order of the extents, so whoever is next in turn stays next until a third is as long.) So a code is a
// shift, two 2-way and three 3-way interleavings, whatever the bounds; `plan_codes` finds the stretches.
//
// Bit-exact on every device: coordinates are integers from the start (a float's bits, shifted), so that nothing is lost in the
// subtraction from a far corner and an object in the middle of the scene lies in the middle of the code; what is left of float
// arithmetic is +, −, · (correctly rounded by Vulkan's rules, `precise` against contraction).
#ifndef HEDGEROW_BVH_CODES
#define HEDGEROW_BVH_CODES
#include "gpu/pass.glsl"
#include "bvh/geometry.glsl"

const uint ORDER_REGULAR = 0;
const uint ORDER_SORTED = 1;
const uint ORDER_VARIABLE = 2;

// What to encode: Codes in src/bvh/codes.rs, as the shaders take it.
struct CodeKind {
    uint order;
    uint bits;         // of the code
    uint size_group;   // coordinate bits before each bit of the size; 0: no size
    bool concise;
};

// One axis of the bounds, for `fraction_of`.
struct Axis {
    uint exponent;    // biased, of the larger of |lo| and |hi|: the unit is 2^-62 of what it bounds
    uint shift;       // brings the extent's leading bit to the top
    uvec2 lo;         // the low corner
    uvec2 inverse;    // (2^64 / extent − 1) · 2^63, rounded up, for the shifted extent; 0 for a flat axis
};

// The recipe for given bounds. Stretch 0 is one axis alone, 1 two in turn, 2 three in turn; per axis, how many bits it has
// in a stretch, and at which bit of the code the lowest of them lies.
struct CodePlan {
    Axis axes[3];
    float size_prescale;
    float size_reciprocal;
    float area_scale;
    uvec3 bits[3];
    uvec3 low[3];
};

// ---- 64-bit integers as (low, high) ----

uvec2 shift_left(uvec2 v, uint s) {
    if (s == 0) return v;
    return s >= 32 ? uvec2(0, s >= 64 ? 0 : v.x << (s - 32)) : uvec2(v.x << s, v.y << s | v.x >> (32 - s));
}

uvec2 shift_right(uvec2 v, uint s) {
    if (s == 0) return v;
    return s >= 32 ? uvec2(s >= 64 ? 0 : v.y >> (s - 32), 0) : uvec2(v.x >> s | v.y << (32 - s), v.y >> s);
}

// `count` bits of `v` from bit `from` below the top, at the bottom.
uvec2 bits_of(uvec2 v, uint from, uint count) {
    return shift_right(shift_left(v, from), 64 - count);
}

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
    uint root = min(uint(sqrt(float(x))), 65535u);
    // The device's root errs by a few ulp: at most one step either way, two to be safe.
    for (int i = 0; i < 2; ++i) {
        if (root * root > x) root -= 1;
    }
    for (int i = 0; i < 2; ++i) {
        if (root < 65535u && (root + 1) * (root + 1) <= x) root += 1;
    }
    return root;
}

// ---- coordinates as 64-bit fractions of the extent ----

uvec2 add(uvec2 a, uvec2 b) {
    uint carry;
    uint low = uaddCarry(a.x, b.x, carry);
    return uvec2(low, a.y + b.y + carry);
}

uvec2 subtract(uvec2 a, uvec2 b) {
    uint borrow;
    uint low = usubBorrow(a.x, b.x, borrow);
    return uvec2(low, a.y - b.y - borrow);
}

bool is_below(uvec2 a, uvec2 b) {
    return a.y != b.y ? a.y < b.y : a.x < b.x;
}

// A float in units of 2^-62 of the axis' magnitude, two's complement; what is smaller than a unit is cut off.
uvec2 fixed_point(float v, uint exponent) {
    uint bits = floatBitsToUint(v);
    uint own = bits >> 23 & 0xFFu;
    uint mantissa = own == 0 ? 0 : bits & 0x7FFFFFu | 0x800000u;
    int shift = int(own) - int(exponent) + 38;   // at most 38
    uint right = uint(clamp(-shift, 0, 31)), left = uint(clamp(shift, 0, 31)), over = uint(clamp(shift - 32, 0, 31));
    uint low = shift >= 32 ? 0 : mantissa >> right << left;
    // The bits that leave the low word; in two steps, as a shift by 32 is undefined.
    uint high = shift >= 32 ? mantissa << over : shift <= 0 ? 0 : mantissa >> 1 >> (31 - left);
    uvec2 magnitude = uvec2(low, high);
    return (bits & 0x80000000u) != 0 ? subtract(uvec2(0), magnitude) : magnitude;
}

// (a · b) >> 63 for a · b < 2^127.
uvec2 multiply_shift_63(uvec2 a, uvec2 b) {
    uint high00, low00, high01, low01, high10, low10, high11, low11, carry;
    umulExtended(a.x, b.x, high00, low00);
    umulExtended(a.x, b.y, high01, low01);
    umulExtended(a.y, b.x, high10, low10);
    umulExtended(a.y, b.y, high11, low11);
    // Words 1, 2, 3 of the product.
    uint word1 = uaddCarry(high00, low01, carry);
    uint carries = carry;
    word1 = uaddCarry(word1, low10, carry);
    carries += carry;
    uvec2 words = add(add(uvec2(low11, high11), uvec2(high01, 0)), add(uvec2(high10, 0), uvec2(carries, 0)));
    return uvec2(words.x << 1 | word1 >> 31, words.y << 1 | words.x >> 31);
}

Axis axis_of(float lo, float hi) {
    Axis axis;
    axis.exponent = max(floatBitsToUint(lo) >> 23 & 0xFFu, floatBitsToUint(hi) >> 23 & 0xFFu);
    axis.lo = fixed_point(lo, axis.exponent);
    axis.inverse = uvec2(0);
    axis.shift = 0;
    uvec2 extent = subtract(fixed_point(hi, axis.exponent), axis.lo);
    if (extent == uvec2(0)) return axis;
    axis.shift = uint(extent.y != 0 ? 31 - findMSB(extent.y) : 63 - findMSB(extent.x));
    extent = shift_left(extent, axis.shift);
    // Long division of (2^64 − extent) · 2^63 by the extent.
    uvec2 remainder = subtract(uvec2(0), extent);
    uvec2 quotient = uvec2(0);
    if (!is_below(remainder, extent)) {
        remainder = subtract(remainder, extent);
        quotient.x = 1;
    }
    for (int i = 0; i < 63; ++i) {
        bool overflows = (remainder.y & 0x80000000u) != 0;
        remainder = shift_left(remainder, 1);
        quotient = shift_left(quotient, 1);
        if (overflows || !is_below(remainder, extent)) {
            remainder = subtract(remainder, extent);
            quotient.x |= 1;
        }
    }
    if (remainder != uvec2(0)) quotient = add(quotient, uvec2(1, 0));
    axis.inverse = quotient;
    return axis;
}

// Where `v` lies between the corners, as a 64-bit fraction.
uvec2 fraction_of(float v, Axis axis) {
    uvec2 at = fixed_point(v, axis.exponent);
    uvec2 distance = subtract(at, axis.lo);
    if ((distance.y & 0x80000000u) != 0) distance = uvec2(0);   // rounded to below the corner
    distance = shift_left(distance, axis.shift);
    uvec2 fraction = add(distance, multiply_shift_63(distance, axis.inverse));
    return is_below(fraction, distance) ? uvec2(0xFFFFFFFFu) : fraction;   // the high corner itself
}

// ---- the plan ----

Box code_bounds(Box boxes, Box centroids, bool concise) {
    if (!concise) return boxes;
    // Riemersma 2024, equation 15.
    precise vec3 difference = max(min(centroids.lo - boxes.lo, boxes.hi - centroids.hi), vec3(0));
    precise vec3 lo = boxes.lo + difference;
    precise vec3 hi = boxes.hi - difference;
    return Box(lo, hi);
}

// The exponent by which areas are scaled: src/bvh/sah.rs, area_scale.
float area_scale_of(Box scene) {
    precise vec3 half_extent = 0.5 * scene.hi - 0.5 * scene.lo;
    float magnitude = max(max(half_extent.x, max(half_extent.y, half_extent.z)), 0.0);
    vec3 corner = max(abs(scene.lo), abs(scene.hi));
    float farthest = max(corner.x, max(corner.y, corner.z));
    ivec2 exponent = ivec2(floatBitsToUint(vec2(magnitude, farthest)) >> 23 & 0xFFu);
    return uintBitsToFloat(uint(min(clamp(127 + 127 - exponent.x, 1, 254), 3 * 127 - 1 - exponent.y)) << 23);
}

// x before y before z where equal.
uint longest_axis(ivec3 keys) {
    uint xy = keys.y > keys.x ? 1 : 0;
    return keys.z > keys[xy] ? 2 : xy;
}

uint coordinate_bits(CodeKind kind) {
    return kind.size_group == 0 ? kind.bits : kind.bits - kind.bits / (kind.size_group + 1);
}

CodePlan plan_codes(CodeKind kind, Box bounds, Box scene) {
    CodePlan plan;
    for (uint axis = 0; axis < 3; ++axis) plan.axes[axis] = axis_of(bounds.lo[axis], bounds.hi[axis]);
    vec3 magnitude = max(abs(bounds.lo), abs(bounds.hi));
    plan.size_prescale = prescale_of(max(magnitude.x, max(magnitude.y, magnitude.z)));
    precise vec3 e = bounds.hi * plan.size_prescale - bounds.lo * plan.size_prescale;
    precise float diagonal2 = e.x * e.x + e.y * e.y + e.z * e.z;
    plan.size_reciprocal = reciprocal_or_zero(diagonal2);
    plan.area_scale = area_scale_of(scene);

    // Extents as integers: halving is taking one from the exponent.
    precise vec3 half_extent = 0.5 * bounds.hi - 0.5 * bounds.lo;
    ivec3 keys = mix(ivec3(-0x7F000000), floatBitsToInt(half_extent), greaterThan(half_extent, vec3(0)));
    for (uint stretch = 0; stretch < 3; ++stretch) {
        plan.bits[stretch] = uvec3(0);
        plan.low[stretch] = uvec3(0);
    }
    uint sorted[3] = uint[3](0, 1, 2);
    if (kind.order == ORDER_SORTED) {
        // Longest first, x before y before z where equal.
        uint first = longest_axis(keys);
        ivec3 others = keys;
        others[first] = -0x7FFFFFFF;
        uint second = longest_axis(others);
        sorted = uint[3](first, second, 3 - first - second);
    }
    uint total = coordinate_bits(kind);
    uint seen = 0;   // axes so far, a bit each
    for (uint taken = 0; taken < total; ++taken) {
        uint axis = kind.order == ORDER_VARIABLE ? longest_axis(keys) : sorted[taken % 3];
        keys[axis] -= 1 << 23;
        seen |= 1 << axis;
        uint stretch = kind.order == ORDER_VARIABLE ? bitCount(seen) - 1 : 2;
        plan.bits[stretch][axis] += 1;
        plan.low[stretch][axis] = total - 1 - taken;
    }
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

// The code bits of one axis.
uvec2 axis_bits(CodePlan plan, uint axis, float centroid_coordinate) {
    uvec2 q = fraction_of(centroid_coordinate, plan.axes[axis]);
    uint alone = plan.bits[0][axis], paired = plan.bits[1][axis], tripled = plan.bits[2][axis];
    uint three = bits_of(q, alone + paired, tripled).x;
    uvec2 code = shift_left(uvec2(spread_by_3(three & 0x7FFu), spread_by_3(three >> 11) << 1), plan.low[2][axis]);
    if (alone + paired > 0) {
        uint two = bits_of(q, alone, paired).x;
        code |= shift_left(uvec2(spread_by_2(two & 0xFFFFu), spread_by_2(two >> 16)), plan.low[1][axis]);
        code |= shift_left(bits_of(q, 0, alone), plan.low[0][axis]);
    }
    return code;
}

// Diagonal of the box over that of the scene, as a 16-bit fraction.
uint size_of(CodePlan plan, Box b) {
    precise vec3 e = b.hi * plan.size_prescale - b.lo * plan.size_prescale;
    precise float squared = (e.x * e.x + e.y * e.y + e.z * e.z) * plan.size_reciprocal;
    if (squared >= 1.0) return 65535u;
    precise float fixed_point = squared * 4294967296.0;
    return integer_root(uint(fixed_point));
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

uint narrow_axis_bits(CodePlan plan, uint axis, float centroid_coordinate) {
    uint q = fraction_of(centroid_coordinate, plan.axes[axis]).y;
    uint alone = plan.bits[0][axis], paired = plan.bits[1][axis], tripled = plan.bits[2][axis];
    uint code = spread_by_3(bits_of(q, alone + paired, tripled)) << plan.low[2][axis];
    code |= spread_by_2(bits_of(q, alone, paired)) << plan.low[1][axis];
    return code | bits_of(q, 0, alone) << plan.low[0][axis];
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

uint narrow_encode(CodeKind kind, CodePlan plan, Box b) {
    vec3 at = centroid_of(b);
    uint code = narrow_axis_bits(plan, 0, at.x) | narrow_axis_bits(plan, 1, at.y)
              | narrow_axis_bits(plan, 2, at.z);
    if (kind.size_group != 0) code = narrow_with_size(kind, code, size_of(plan, b));
    return min(code, inactive_code(kind).x - 1);
}

uvec2 wide_encode(CodeKind kind, CodePlan plan, Box b) {
    vec3 at = centroid_of(b);
    uvec2 code = axis_bits(plan, 0, at.x) | axis_bits(plan, 1, at.y) | axis_bits(plan, 2, at.z);
    if (kind.size_group != 0) code = with_size(kind, code, size_of(plan, b));
    if (code == inactive_code(kind)) code.x -= 1;
    return code;
}
#endif
