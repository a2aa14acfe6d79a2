#version 460
#define HEDGEROW_BUILD_BY_ONE_DISPATCH
// All phases of the H-PLOC build in one dispatch, from the task pool: see bvh/hploc.glsl for the phases' contracts.
//
// needs  the state as bvh/hploc/reset.comp writes it, and one barrier before; any number of workgroups from one up
#include "bvh/hploc.glsl"
#include "bvh/collapse.glsl"

void main() {
    parts = build_state().saved_parts;
    PoolState pool = PoolState(scratch_address);
    PoolCursor cursor = pool_start();
    uint sorted = phases_before_hierarchy();
    // Every round takes a ticket; there are fewer than 2^32.
    while (true) {
        pool_take(pool, cursor);
        if (!cursor.working) break;
        if (cursor.phase < sorted) encode_from_pool(cursor.phase, cursor.task);
        else if (cursor.phase == sorted) hploc_begin(cursor.task);
        else if (cursor.phase == sorted + 1u) hploc_hierarchy(cursor.task);
        else if (cursor.phase == sorted + 2u) collapse_above(cursor.task);
        else if (cursor.phase == sorted + 3u) collapse_place(cursor.task);
        else collapse_records(cursor.task);
        pool_finish(pool);
    }
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) {
        Structure structure = Structure(structure_address);
        atomicOr(structure.header.status, STATUS_SPIN_RAN_OUT);
    }
}
