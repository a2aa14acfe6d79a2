#version 460
// How many entries of each chunk are opened: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

shared uint counts[2];

void main() {
    if (gl_LocalInvocationIndex < 2u) counts[gl_LocalInvocationIndex] = 0u;
    barrier();
    Selection s = selection_of_round();
    uvec2 range = range_of_chunk(gl_WorkGroupID.x);
    uvec2 found = uvec2(0);
    for (uint i = range.x + gl_LocalInvocationIndex; i < range.y; i += gl_WorkGroupSize.x) found += kind_of(gains.value[i], s);
    atomicAdd(counts[0], found.x);
    atomicAdd(counts[1], found.y);
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        state.sums[2u * gl_WorkGroupID.x] = counts[0];
        state.sums[2u * gl_WorkGroupID.x + 1u] = counts[1];
    }
}
