#version 460
// The nodes of the tree and their weights, bottom-up in one pass: see bvh/hploc.glsl for the contract.
#include "bvh/hploc.glsl"

void main() {
    uint task = spread_task(group_number());
    if (task != NONE) hploc_hierarchy(task);
}
