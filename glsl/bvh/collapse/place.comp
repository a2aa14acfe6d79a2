#version 460
// Leaves, and the order of a walk: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    uint task = spread_task(group_number());
    if (task != NONE) collapse_place(task);
}
