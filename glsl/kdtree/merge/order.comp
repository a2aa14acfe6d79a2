#version 460
// Where subtrees go, and the header of the merged tree; workgroups share the tiles. See kdtree/merge.glsl.
#include "kdtree/merge/build.glsl"

void main() {
    uint tiles = PoolState(state_address).tasks[PHASE_ORDER];
    for (uint i = group_number(); i < tiles; i += gl_NumWorkGroups.x) kd_order_merged(i);
}
