#version 460
// What names each slot and each record: see bvh/epo.glsl for the contract.
#include "bvh/epo.glsl"

void tell(Child child, uint slots, uint records, uint name) {
    if (child.count == 0) {
        if (child.index < slots) parents.word[child.index] = name;
        return;
    }
    uint end = min(child.index, records) + min(child.count, records - min(child.index, records));
    for (uint record = child.index; record < end; ++record) parents.word[slots + record] = name;
}

void main() {
    uint slots = structure.header.node_slots, records = structure.header.primitive_count;
    uint begin = first + group_number() * gl_WorkGroupSize.x * rounds + gl_LocalInvocationIndex;
    for (uint round = 0; round < rounds; ++round) {
        uint slot = begin + round * gl_WorkGroupSize.x;
        if (slot < slots && structure.nodes[slot].left.count != UNUSED) {
            tell(structure.nodes[slot].left, slots, records, 2 * slot);
            tell(structure.nodes[slot].right, slots, records, 2 * slot + 1);
        }
    }
}
