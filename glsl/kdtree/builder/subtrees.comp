#version 460
// Tasks of few references of a level, to their leaves; workgroups share them. See kdtree/builder.glsl.
#include "kdtree/small.glsl"

void main() {
    KdState state = build_state();
    uint count = PoolState(state_address).tasks[bin_phase(level)] - state.binned_chunks[level];
    for (uint i = group_number(); i < count; i += gl_NumWorkGroups.x) kd_small(state.first_subtree[level] + i, level);
}
