// Reciprocals that are correctly rounded on every device, so that the bits made of them are those of the host. Vulkan lets a device's own
// err by 2.5 units in the last place; CPUs round theirs correctly.
#ifndef HEDGEROW_GPU_RECIPROCAL
#define HEDGEROW_GPU_RECIPROCAL

// A shader that knows its device to divide exactly may say so before it includes this, by a constant or specialisation constant.
#ifndef HEDGEROW_DIVISION_IS_EXACT
#define HEDGEROW_DIVISION_IS_EXACT false
#endif

// A float's mantissa with its leading bit.
int hedgerow_mantissa(float x) {
    return int(floatBitsToUint(x) & 0x7FFFFFu | 0x800000u);
}

// 1 / x, for normal x with a normal reciprocal, by an estimate of the reciprocal of its mantissa (in [1, 2)) that is three units off at most.
float hedgerow_rounded_reciprocal(float x, float estimate) {
    const float BELOW_ONE = uintBitsToFloat(0x3F7FFFFFu);
    int mantissa = hedgerow_mantissa(x), quotient = hedgerow_mantissa(clamp(estimate, 0.5, BELOW_ONE));
    // What is left of 2^47 over the mantissa, twice. It is at most seven times that, so the last 32 bits say all.
    int rest = -2 * (quotient * mantissa);
    // A tie would need a mantissa that divides a power of two: of 2^23, whose quotient 2^24 goes on into the exponent below, nothing is left.
    quotient += int(rest > mantissa) + int(rest > 3 * mantissa) + int(rest > 5 * mantissa);
    quotient -= int(rest < -mantissa) + int(rest < -3 * mantissa) + int(rest < -5 * mantissa);
    // The mantissa inverted is quotient · 2^-24.
    uint bits = floatBitsToUint(x), exponent = 253u - (bits >> 23 & 0xFFu);
    return uintBitsToFloat(bits & 0x80000000u | (exponent << 23) + uint(quotient - 0x800000));
}

// 1 / x; where either is not normal, whatever the device makes of it.
float hedgerow_reciprocal(float x) {
    uint bits = floatBitsToUint(x), exponent = bits >> 23 & 0xFFu;
    bool is_rounded = !HEDGEROW_DIVISION_IS_EXACT && exponent >= 1u && exponent <= 252u;
    precise float reciprocal = 1.0 / (is_rounded ? uintBitsToFloat(bits & 0x7FFFFFu | 0x3F800000u) : x);
    if (is_rounded) reciprocal = hedgerow_rounded_reciprocal(x, reciprocal);
    return reciprocal;
}
#endif
