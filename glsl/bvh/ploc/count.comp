#version 460
// How many clusters of each tile are left: see bvh/ploc.glsl for the contract. Workgroups share the tiles that there are.
#include "bvh/ploc.glsl"

// The round's, even or odd.
layout(constant_id = 8) const uint ROUND = 0;

void main() {
    uint tiles = tiles_of(clusters_in(ROUND));
    for (uint task = group_number(); task < tiles; task += gl_NumWorkGroups.x) ploc_count(task, ROUND);
}
