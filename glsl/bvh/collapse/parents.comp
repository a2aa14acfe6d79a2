#version 460
// The parents of all nodes and primitives: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    uint task = spread_task(group_number());
    if (task != NONE) collapse_parents(task);
}
