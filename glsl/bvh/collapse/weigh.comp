#version 460
// Counts and costs of all nodes, bottom-up: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    uint task = spread_task(group_number());
    if (task != NONE) collapse_weigh(task);
}
