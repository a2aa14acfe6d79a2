#version 460
// A cluster of each primitive: see bvh/hploc.glsl for the contract.
#include "bvh/hploc.glsl"

void main() {
    uint task = spread_task(group_number());
    if (task != NONE) hploc_begin(task);
}
