#version 460
// Both trees become the one that is taken: see trace/trial.glsl for the contract. Records are the same in both.
#include "trace/trial.glsl"

void main() {
    bool is_taken = result.word[RESULT_IS_TAKEN] != 0u;
    uint slots = structure.header.node_slots;
    if (!are_of_one(structure.header, copy.header)) return;
    for (uint k = 0, i = grid_item(0); i < slots; i = grid_item(++k)) {
        if (is_taken) structure.nodes[i] = copy.nodes[i];
        else copy.nodes[i] = structure.nodes[i];
    }
    // What says that they are of one stays as it is: others may still ask.
    if (grid_item(0) != 0u) return;
    if (is_taken) {
        structure.header.status = copy.header.status;
        structure.header.child_order = copy.header.child_order;
    } else {
        copy.header.status = structure.header.status;
        copy.header.child_order = structure.header.child_order;
    }
}
