#version 460
// Treelets, bottom-up in one pass: see bvh/hlbvh.glsl for the contract.
#include "bvh/hlbvh/treelets.glsl"

void main() {
    hlbvh_treelets(group_number());
}
