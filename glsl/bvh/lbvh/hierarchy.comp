#version 460
// Hierarchy, boxes, costs and collapsing, bottom-up in one pass: see bvh/lbvh.glsl for the contract.
#include "bvh/lbvh.glsl"

void main() {
    lbvh_hierarchy(group_number());
}
