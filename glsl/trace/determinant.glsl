// The exact sign of a·b − c·d, and its leading 24 bits, from integers alone: the twin of src/trace/determinant.rs.
#ifndef HEDGEROW_TRACE_DETERMINANT
#define HEDGEROW_TRACE_DETERMINANT

// mantissa · 2^exponent; 2^23 ≤ |mantissa| < 2^24, or 0.
struct HedgerowScaled {
    int mantissa;
    int exponent;
};

// The value divided by 2^exponent; below 2^-60 of that it is zero.
float hedgerow_relative_to(HedgerowScaled value, int exponent) {
    int shift = exponent - value.exponent;
    bool is_zero = value.mantissa == 0 || shift > 60;
    return is_zero ? 0.0 : float(value.mantissa) * uintBitsToFloat(uint(127 - shift) << 23);
}

// ±magnitude · 2^exponent; the magnitude as (low, high).
struct HedgerowProduct {
    uvec2 magnitude;
    int exponent;
    bool negative;
};

// Below the exponent of every other product: a zero never outweighs one by what it is multiplied with.
const int HEDGEROW_ZERO_EXPONENT = -1000;

HedgerowProduct hedgerow_product(float a, float b) {
    uvec2 bits = uvec2(floatBitsToUint(a), floatBitsToUint(b));
    uvec2 exponents = bits >> 23u & 0xffu;
    // Subnormal numbers are taken as zero.
    uvec2 mantissas = mix(bits & 0x7fffffu | 0x800000u, uvec2(0), equal(exponents, uvec2(0)));
    HedgerowProduct product;
    umulExtended(mantissas.x, mantissas.y, product.magnitude.y, product.magnitude.x);
    product.exponent = product.magnitude == uvec2(0) ? HEDGEROW_ZERO_EXPONENT : int(exponents.x + exponents.y) - 300;
    product.negative = (bits.x ^ bits.y) >> 31u == 1u;
    return product;
}

uvec2 hedgerow_shifted_right(uvec2 x, uint count) {
    uvec2 shifted = uvec2(x.x >> count | x.y << (32u - count), x.y >> count);
    if (count == 0u) shifted = x;
    if (count >= 32u) shifted = uvec2(x.y >> (count - 32u), 0);
    return shifted;
}

const uint HEDGEROW_ROOM = 14u;

HedgerowScaled hedgerow_difference_of_products(float a, float b, float c, float d) {
    HedgerowProduct large = hedgerow_product(a, b);
    HedgerowProduct small = hedgerow_product(c, d);
    small.negative = !small.negative;
    if (small.exponent > large.exponent) {
        HedgerowProduct other = large;
        large = small;
        small = other;
    }
    uint apart = uint(clamp(large.exponent - small.exponent, 0, 63));
    uvec2 high = uvec2(large.magnitude.x << HEDGEROW_ROOM, large.magnitude.y << HEDGEROW_ROOM | large.magnitude.x >> (32u - HEDGEROW_ROOM));
    uvec2 low = uvec2(small.magnitude.x << HEDGEROW_ROOM, small.magnitude.y << HEDGEROW_ROOM | small.magnitude.x >> (32u - HEDGEROW_ROOM));
    low = hedgerow_shifted_right(low, apart);

    uvec2 magnitude;
    bool negative = large.negative;
    uint carry;
    if (large.negative == small.negative) {
        magnitude.x = uaddCarry(high.x, low.x, carry);
        magnitude.y = high.y + low.y + carry;
    } else {
        if (high.y < low.y || high.y == low.y && high.x < low.x) {
            uvec2 other = high;
            high = low;
            low = other;
            negative = !negative;
        }
        magnitude.x = usubBorrow(high.x, low.x, carry);
        magnitude.y = high.y - low.y - carry;
    }
    bool is_zero = magnitude == uvec2(0);
    int highest = magnitude.y != 0u ? 32 + findMSB(magnitude.y) : findMSB(magnitude.x);
    int cut = highest - 23;
    uint mantissa = cut >= 0 ? hedgerow_shifted_right(magnitude, uint(cut)).x : magnitude.x << uint(-cut);
    return HedgerowScaled(is_zero ? 0 : negative ? -int(mantissa) : int(mantissa),
                          is_zero ? 0 : large.exponent - int(HEDGEROW_ROOM) + cut);
}
#endif
