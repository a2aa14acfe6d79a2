#version 460
// A cluster of each treelet: see bvh/hlbvh.glsl for the contract.
#include "bvh/hlbvh/treelets.glsl"

void main() {
    hlbvh_gather(group_number());
}
