#version 460
// What was built to the places of the marked leaves; workgroups share the leaves. See kdtree/merge.glsl.
#include "kdtree/merge/build.glsl"

void main() {
    uint tiles = PoolState(state_address).tasks[PHASE_HOOK];
    for (uint i = group_number(); i < tiles; i += gl_NumWorkGroups.x) kd_hook(i);
}
