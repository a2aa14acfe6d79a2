#version 460
// Where subtrees go, and the header; workgroups share the tiles. See kdtree/builder.glsl.
#include "kdtree/place.glsl"

void main() {
    uint tiles = PoolState(state_address).tasks[PHASE_ORDER];
    for (uint i = group_number(); i < tiles; i += gl_NumWorkGroups.x) kd_order_subtrees(i);
}
