#version 460
// Where large nodes begin: see bvh/collapse.glsl for the contract.
#include "bvh/collapse.glsl"

void main() {
    uint task = spread_task(group_number());
    if (task != NONE) collapse_above(task);
}
