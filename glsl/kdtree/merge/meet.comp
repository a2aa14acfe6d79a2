#version 460
// Pairs of leaves of objects' trees in leaves of the static one: the triangles there; workgroups share the leaves. See kdtree/merge.glsl.
#include "kdtree/merge/push.glsl"

void main() {
    uint tiles = PoolState(state_address).tasks[PUSH_STEPS];
    for (uint i = group_number(); i < tiles; i += gl_NumWorkGroups.x) kd_meet(i);
}
