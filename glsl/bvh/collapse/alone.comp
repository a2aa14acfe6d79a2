#version 460
// All steps for a small tree, by one workgroup: see bvh/collapse.glsl for the contract.
//
// A chain of dispatches costs a small tree more than its work.
#define HEDGEROW_ONE_WORKGROUP
#include "bvh/collapse.glsl"

void main() {
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1u) / tile;
    for (uint task = 0; task < tiles; ++task) collapse_parents(task);
    next_phase();
    for (uint task = 0; task < tiles; ++task) collapse_weigh(task);
    next_phase();
    for (uint task = 0; task < tiles; ++task) collapse_above(task);
    next_phase();
    for (uint task = 0; task < tiles; ++task) collapse_place(task);
    next_phase();
    for (uint task = 0; task < tiles; ++task) collapse_records(task);
}
