#version 460
// Where the treelets of each tile go, and how many there are; one workgroup: see bvh/hlbvh.glsl for the contract.
#include "bvh/hlbvh/treelets.glsl"

void main() {
    hlbvh_scan();
}
