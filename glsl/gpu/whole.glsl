// Floats to integers by their bits. lavapipe's own conversion goes lane by lane: it was 7% of writing quantised nodes and 5% of encoding.
#ifndef HEDGEROW_GPU_WHOLE
#define HEDGEROW_GPU_WHOLE

// x, rounded down, of 0 <= x < 2^23: in the sum the last bit counts ones.
uint whole(float x) {
    return floatBitsToUint(floor(x) + 8388608.0) & 0x7FFFFFu;
}

uvec3 whole(vec3 x) {
    return floatBitsToUint(floor(x) + 8388608.0) & 0x7FFFFFu;
}

// The same of 0 <= x < 2^32.
uint long_whole(float x) {
    uint bits = floatBitsToUint(x), mantissa = bits & 0x7FFFFFu | 0x800000u;
    int halvings = 127 + 23 - int(bits >> 23);
    return halvings > 0 ? mantissa >> min(halvings, 31) : mantissa << (-halvings & 31);
}
#endif
