// All phases of bvh/encode.glsl up to the sort, by one workgroup, with a barrier behind.
//
// needs  column_keys: where counters are private, the keys of a lane's strip; otherwise those of a tile
#ifndef HEDGEROW_BVH_ENCODE_ALONE
#define HEDGEROW_BVH_ENCODE_ALONE
#include "bvh/encode.glsl"

void encode_alone() {
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1u) / tile;
    reset_build(0);
    if (HAS_SECTIONS) find_fences();
    next_phase();
    for (uint task = 0; task < tiles; ++task) find_bounds(task);
    next_phase();
    make_plan();
    next_phase();
    if (HAS_GRID) {
        for (uint task = 0; task < tiles; ++task) {
            count_cells(task);
            barrier();   // the task's use of shared memory is over
        }
        next_phase();
        find_prefixes();
        next_phase();
    }
    for (uint task = 0; task < tiles; ++task) encode(task);
    next_phase();
    for (uint pass = passes_left_out(); pass < passes; ++pass) {
        Radix r = radix_of_pass(pass);
        for (uint task = 0; task * COLUMNS_A_TASK < columns_of_sort(); ++task) radix_count(r, task);
        next_phase();
        for (uint task = 0; task * DIGITS_A_TASK < DIGITS; ++task) radix_scan(r, task);
        next_phase();
        for (uint task = 0; task * COLUMNS_A_TASK < columns_of_sort(); ++task) radix_scatter(r, task);
        next_phase();
    }
}
#endif
