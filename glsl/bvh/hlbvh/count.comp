#version 460
// How many treelets end in each tile: see bvh/hlbvh.glsl for the contract.
#include "bvh/hlbvh/treelets.glsl"

void main() {
    hlbvh_count(group_number());
}
