#version 460
// A step of objects' trees down the static one; workgroups share the items. See kdtree/merge.glsl.
#include "kdtree/merge/push.glsl"

void main() {
    uint tiles = PoolState(state_address).tasks[level];
    for (uint i = group_number(); i < tiles; i += gl_NumWorkGroups.x) kd_push(i, level);
}
