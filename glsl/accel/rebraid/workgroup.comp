#version 460
// All rounds over few entries, by one workgroup: see accel/rebraid.glsl for their contract.
//
// reads   the instances, the structures below
// writes  entries; the sample; gains, state: zeroed here
// needs   barriers before and after; any subgroup size; one workgroup, one chunk
#include "accel/rebraid.glsl"

void main() {
    for (uint i = gl_LocalInvocationIndex; i < capacity; i += gl_WorkGroupSize.x) gains.value[i] = UNKNOWN;
    for (uint i = gl_LocalInvocationIndex; i < ROUNDS * CLASSES; i += gl_WorkGroupSize.x) state.histogram[i] = 0u;
    rebraid_fences();
    next_phase();
    for (uint round = 0; round < ROUNDS && !is_over(round); ++round) {
        rebraid_weigh(round, 0u);
        next_phase();
        rebraid_select(round, 0u);
        next_phase();
        rebraid_open(round, 0u);
        next_phase();
    }
}
