#version 460
// References to the next level and to leaves, nodes, and the tasks of the next level; workgroups share them. See kdtree/builder.glsl.
#include "kdtree/distribute.glsl"

void main() {
    uint items = PoolState(state_address).tasks[bin_phase(level) + 2u];
    for (uint i = group_number(); i < items; i += gl_NumWorkGroups.x) kd_distribute(i, level);
}
