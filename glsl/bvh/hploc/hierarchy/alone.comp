#version 460
// The nodes of a tree of few primitives and their weights, by one workgroup: see bvh/hploc.glsl for the contract.
#define HEDGEROW_ONE_WORKGROUP
#include "bvh/hploc.glsl"

void main() {
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1u) / tile;
    for (uint task = 0; task < tiles; ++task) hploc_begin(task);
    next_phase();
    for (uint task = 0; task < tiles; ++task) {
        hploc_hierarchy(task);
        next_phase();
    }
}
