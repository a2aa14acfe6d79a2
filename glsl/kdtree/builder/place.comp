#version 460
// Subtrees to their places; workgroups share them. See kdtree/builder.glsl.
#include "kdtree/place.glsl"

void main() {
    uint tiles = PoolState(state_address).tasks[PHASE_PLACE];
    for (uint i = group_number(); i < tiles; i += gl_NumWorkGroups.x) kd_place(i);
}
