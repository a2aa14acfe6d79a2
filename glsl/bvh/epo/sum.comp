#version 460
// Sums of up to 64 sums: see bvh/epo.glsl for the contract.
#include "bvh/epo.glsl"

void main() {
    uint kept = max((count + 63) / 64, 1);
    uint i = invocation_number();
    if (i >= kept) return;
    vec3 sum = vec3(0.0);
    for (uint k = i; k < count; k += kept) sum += sums.of[k];
    results.of[i] = sum;
}
