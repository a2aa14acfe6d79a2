#version 460
// Opens the nodes of several levels, by one workgroup: see bvh/wide/collapse.glsl for the contract.
//
// For levels of few nodes: the first ones, and those that only trees out of balance have.
#include "bvh/wide/open.glsl"

void main() {
    open_levels(level, level_end);
}
