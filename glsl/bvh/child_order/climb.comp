#version 460
// Children in order, from the leaves up: see bvh/child_order.glsl for the contract.
#include "bvh/child_order.glsl"

void main() {
    uint first = group_number() * gl_WorkGroupSize.x * rounds + gl_LocalInvocationIndex;
    uint node_slots = slots_in_use();
    if (first == 0u && node_slots != 0u) {
        structure.header.child_order = 1u;
        structure.header.near_node = 0u;
        structure.header.far_sides = 0u;
    }
    for (uint round = 0; round < rounds; ++round) {
        uint slot = first + round * gl_WorkGroupSize.x;
        if (slot < node_slots) child_order_climb(slot, node_slots);
    }
}
