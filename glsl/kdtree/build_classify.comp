#version 460
// The sides of the references of a level, and the scan behind them; workgroups share the chunks. See kdtree/build.glsl.
#include "kdtree/phases.glsl"

void main() {
    uint items = PoolState(state_address).tasks[bin_phase(level) + 1u];
    for (uint i = group_number(); i < items; i += gl_NumWorkGroups.x) kd_classify(i, level);
}
