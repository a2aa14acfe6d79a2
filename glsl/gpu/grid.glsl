// Items of which only the device knows how many there are, shared by however many workgroups were dispatched: src/gpu/grid.rs.
//
//     for (uint k = 0, i = grid_item(0); i < count; i = grid_item(++k)) …
//
// needs  fewer than 2^31 items; any subgroup size
#ifndef HEDGEROW_GPU_GRID
#define HEDGEROW_GPU_GRID
#include "gpu/pass.glsl"

// Items of an invocation in a piece.
layout(constant_id = 1) const uint GRID_ROUNDS = 1;

uint grid_piece() {
    return gl_WorkGroupSize.x * GRID_ROUNDS;
}

// The k-th item of this invocation.
uint grid_item(uint k) {
    uint piece = k / GRID_ROUNDS * group_count() + group_number();
    return piece * grid_piece() + k % GRID_ROUNDS * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}
#endif
