#version 460
// The parent of every node: see bvh/quality.glsl for the contract.
#include "bvh/quality.glsl"

void main() {
    uint first = group_number() * gl_WorkGroupSize.x * rounds + gl_LocalInvocationIndex;
    uint slots = structure.header.node_slots;
    for (uint round = 0; round < rounds; ++round) {
        uint slot = first + round * gl_WorkGroupSize.x;
        if (slot < slots) {
            Child left = structure.nodes[slot].left, right = structure.nodes[slot].right;
            if (left.count == 0 && left.index < slots) parents.word[left.index] = slot;
            if (right.count == 0 && right.index < slots) parents.word[right.index] = slot;
        }
    }
}
