// Items of which only the device knows how many there are, shared by however many workgroups were dispatched: src/gpu/grid.rs.
//
//     for (uint k = 0, i = grid_item(0); i < count; i = grid_item(++k)) …
//
// needs  fewer than 2^31 items; any subgroup size
#ifndef HEDGEROW_GPU_GRID
#define HEDGEROW_GPU_GRID
#include "gpu/pass.glsl"

// Items of an invocation in a piece, and above SPREAD_BIT whether pieces are spread: `Grid::word` in src/gpu/grid.rs.
layout(constant_id = 1) const uint GRID_WORD = 1;
const uint SPREAD_BIT = 16;
const uint GRID_ROUNDS = GRID_WORD & (1u << SPREAD_BIT) - 1u;
const bool GRID_IS_SPREAD = GRID_WORD >> SPREAD_BIT != 0u;

uint grid_piece() {
    return gl_WorkGroupSize.x * GRID_ROUNDS;
}

// Which piece a workgroup begins with. Where pieces are spread, the first ones go to workgroups that lie far apart: the number has its bits in
// reverse, if there is a power of two of them.
uint first_piece() {
    uint groups = group_count();
    if (!GRID_IS_SPREAD || groups < 2u || (groups & groups - 1u) != 0u) return group_number();
    return bitfieldReverse(group_number()) >> 32u - uint(findLSB(groups));
}

// The k-th item of this invocation.
uint grid_item(uint k) {
#ifdef HEDGEROW_ONE_WORKGROUP
    // What is below comes to that, and is long for a kernel that does everything.
    return k * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
#endif
    uint piece = k / GRID_ROUNDS * group_count() + first_piece();
    return piece * grid_piece() + k % GRID_ROUNDS * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}
#endif
