#version 460
// Opens the nodes of a level: see bvh/wide_collapse.glsl for the contract.
#include "bvh/wide_open.glsl"

void main() {
    uint first = opened_before(level);
    uint count = opened_of(level);
    for (uint k = 0, i = grid_item(0); i < count; i = grid_item(++k)) open(first + i, level, first + count);
}
