#version 460
// All rounds over few entries, by one workgroup: see accel/rebraid.glsl for their contract.
//
// reads   the instances, the structures below
// writes  entries; the sample; gains, state: zeroed here
// needs   barriers before and after; any subgroup size; one workgroup, one chunk
#include "accel/rebraid.glsl"

void main() {
    for (uint i = gl_LocalInvocationIndex; i < ROUNDS * CLASSES; i += gl_WorkGroupSize.x) state.histogram[i] = 0u;
    rebraid_fences();
    next_phase();
    rebraid_weigh(0u);
    next_phase();
    for (uint i = 0; i < ROUNDS && !is_over(i); ++i) {
        rebraid_select(i, 0u);
        next_phase();
        rebraid_list(i, 0u);
        next_phase();
        rebraid_open(i, 0u);
        next_phase();
    }
}
