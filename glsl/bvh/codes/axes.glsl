// Coordinates as fractions of an extent, 64 or 96 bits, in integers throughout: src/bvh/codes/axis.rs explains them and is the twin.
#ifndef HEDGEROW_BVH_CODE_AXES
#define HEDGEROW_BVH_CODE_AXES
#include "gpu/pass.glsl"

// One axis of the bounds, for `fraction_of`.
struct Axis {
    uint exponent;    // biased, of the larger of |lo| and |hi|: the unit is 2^-62 of what it bounds
    uint shift;       // brings the extent's leading bit to the top
    uvec2 lo;         // the low corner
    float corner;     // the same as it was given
    uvec2 inverse;    // (2^64 / extent − 1) · 2^63, rounded up, for the shifted extent; 0 for a flat axis
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
    int shift = int(own) - int(exponent) + 38;
    uint right = uint(clamp(-shift, 0, 31)), left = uint(clamp(shift, 0, 31)), over = uint(clamp(shift - 32, 0, 31));
    uint low = shift >= 32 ? 0 : mantissa >> right << left;
    // The bits that leave the low word; in two steps, as a shift by 32 is undefined.
    uint high = shift >= 32 ? mantissa << over : shift <= 0 ? 0 : mantissa >> 1 >> (31 - left);
    // What is beyond the bound is the bound.
    uvec2 magnitude = shift > 38 ? uvec2(0xFFFFFFFFu, 0x3FFFFFFFu) : uvec2(low, high);
    return (bits & 0x80000000u) != 0 ? subtract(uvec2(0), magnitude) : magnitude;
}

// The product's four words.
uvec4 multiply(uvec2 a, uvec2 b) {
    uint high00, low00, high01, low01, high10, low10, high11, low11, carry;
    umulExtended(a.x, b.x, high00, low00);
    umulExtended(a.x, b.y, high01, low01);
    umulExtended(a.y, b.x, high10, low10);
    umulExtended(a.y, b.y, high11, low11);
    uint word1 = uaddCarry(high00, low01, carry);
    uint carries = carry;
    word1 = uaddCarry(word1, low10, carry);
    carries += carry;
    uvec2 words = add(add(uvec2(low11, high11), uvec2(high01, 0)), add(uvec2(high10, 0), uvec2(carries, 0)));
    return uvec4(low00, word1, words);
}

// (a · b) >> 63 for a · b < 2^127.
uvec2 multiply_shift_63(uvec2 a, uvec2 b) {
    uvec4 words = multiply(a, b);
    return uvec2(words.z << 1 | words.y >> 31, words.w << 1 | words.z >> 31);
}

uint leading_zeros(uvec2 v) {
    return uint(v.y != 0 ? 31 - findMSB(v.y) : 63 - findMSB(v.x));
}

// ---- 96-bit integers, lowest word first ----

uvec3 shift_left(uvec3 v, uint s) {
    uvec3 words = s >= 64 ? uvec3(0, 0, v.x) : s >= 32 ? uvec3(0, v.x, v.y) : v;
    s &= 31;
    if (s == 0) return words;
    return uvec3(words.x << s, words.y << s | words.x >> (32 - s), words.z << s | words.y >> (32 - s));
}

uvec3 add(uvec3 a, uvec3 b, out uint carry) {
    uint carry_x, carry_y, carry_z, more;
    uint x = uaddCarry(a.x, b.x, carry_x);
    uint y = uaddCarry(a.y, b.y, carry_y);
    y = uaddCarry(y, carry_x, more);
    carry_y += more;
    uint z = uaddCarry(a.z, b.z, carry_z);
    z = uaddCarry(z, carry_y, more);
    carry = carry_z + more;
    return uvec3(x, y, z);
}

uvec3 subtract(uvec3 a, uvec3 b) {
    uint carry, low_carry;
    // a + ~b + 1.
    uvec3 sum = add(a, ~b, carry);
    return add(sum, uvec3(1, 0, 0), low_carry);
}

// The same as `fixed_point` in units of 2^-94.
uvec3 wide_fixed_point(float v, uint exponent) {
    uint bits = floatBitsToUint(v);
    uint own = bits >> 23 & 0xFFu;
    uint mantissa = own == 0 ? 0 : bits & 0x7FFFFFu | 0x800000u;
    int shift = int(own) - int(exponent) + 70;
    uvec3 magnitude = shift_left(uvec3(mantissa >> uint(clamp(-shift, 0, 31)), 0, 0), uint(clamp(shift, 0, 70)));
    if (shift > 70) magnitude = uvec3(0xFFFFFFFFu, 0xFFFFFFFFu, 0x3FFFFFFFu);
    return (bits & 0x80000000u) != 0 ? subtract(uvec3(0), magnitude) : magnitude;
}

Axis axis_of(float lo, float hi) {
    Axis axis;
    axis.exponent = max(floatBitsToUint(lo) >> 23 & 0xFFu, floatBitsToUint(hi) >> 23 & 0xFFu);
    axis.lo = fixed_point(lo, axis.exponent);
    axis.corner = lo;
    axis.inverse = uvec2(0);
    axis.shift = 0;
    // Rounded up: what the units cut off must not put the far corner behind the extent.
    uvec3 wide = subtract(wide_fixed_point(hi, axis.exponent), wide_fixed_point(lo, axis.exponent));
    uvec2 extent = add(wide.yz, uvec2(wide.x != 0 ? 1 : 0, 0));
    if (extent == uvec2(0)) return axis;
    axis.shift = leading_zeros(extent);
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

// Where `v` lies between the corners, as a 64-bit fraction; what is outside lies in the corner.
uvec2 fraction_of(float v, Axis axis) {
    uvec2 at = fixed_point(v, axis.exponent);
    uvec2 distance = subtract(at, axis.lo);
    if ((distance.y & 0x80000000u) != 0) distance = uvec2(0);   // rounded to below the corner
    if (leading_zeros(distance) < axis.shift) return uvec2(0xFFFFFFFFu);          // behind the extent
    distance = shift_left(distance, axis.shift);
    uvec2 fraction = add(distance, multiply_shift_63(distance, axis.inverse));
    return is_below(fraction, distance) ? uvec2(0xFFFFFFFFu) : fraction;   // the high corner itself
}

// The same with 96 bits: enough to leave 64 bits within a grid's cell.
uvec3 wide_fraction_of(float v, Axis axis) {
    uvec3 distance = subtract(wide_fixed_point(v, axis.exponent), wide_fixed_point(axis.corner, axis.exponent));
    if ((distance.z & 0x80000000u) != 0) return uvec3(0);
    if (leading_zeros(distance.yz) < axis.shift) return uvec3(0xFFFFFFFFu);
    distance = shift_left(distance, axis.shift);
    // The product's lowest word is left out: it cannot carry.
    uvec4 product = multiply(distance.yz, axis.inverse);
    uvec4 low = multiply(uvec2(distance.x, 0), axis.inverse);
    uint carry;
    uvec3 sum = add(product.xyz, uvec3(low.yz, 0), carry);
    uint top = product.w + carry;
    uvec3 more = uvec3(sum.x >> 31 | sum.y << 1, sum.y >> 31 | sum.z << 1, sum.z >> 31 | top << 1);
    uvec3 fraction = add(distance, more, carry);
    return carry != 0 || top >> 31 != 0 ? uvec3(0xFFFFFFFFu) : fraction;
}

// The distance from `v` to `corner` as a piecewise linear logarithm: octaves, and 22 bits of a fraction.
uint octaves(float v, float corner) {
    uint exponent = max(floatBitsToUint(v) >> 23 & 0xFFu, floatBitsToUint(corner) >> 23 & 0xFFu);
    uvec2 distance = subtract(fixed_point(v, exponent), fixed_point(corner, exponent));
    if ((distance.y & 0x80000000u) != 0) distance = subtract(uvec2(0), distance);
    if (distance == uvec2(0)) distance.x = 1;
    uint zeros = leading_zeros(distance);
    uint mantissa = shift_left(distance, zeros).y >> 9 & 0x3FFFFFu;
    return (exponent + 63 - zeros) << 22 | mantissa;
}
#endif
