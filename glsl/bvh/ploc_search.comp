#version 460
// The nearest cluster of each: see bvh/ploc.glsl for the contract. Workgroups share the tiles that there are.
#include "bvh/ploc.glsl"

// The round's, even or odd.
layout(constant_id = 7) const uint ROUND = 0;

void main() {
    uint tiles = tiles_of(clusters_in(ROUND));
    for (uint task = gl_WorkGroupID.x; task < tiles; task += gl_NumWorkGroups.x) ploc_search(task, ROUND);
}
