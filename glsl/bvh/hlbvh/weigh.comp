#version 460
// Counts and costs above treelets: see bvh/hlbvh.glsl for the contract. Workgroups share the tiles that there are.
#include "bvh/hlbvh.glsl"

void main() {
    uint tiles = tiles_of(treelet_count());
    for (uint task = group_number(); task < tiles; task += gl_NumWorkGroups.x) hlbvh_weigh(task);
}
