#version 460
// All phases of the LBVH build in one dispatch, from the task pool: see bvh/lbvh.glsl for the phases' contracts.
//
// needs  the state as bvh/lbvh_reset.comp writes it, and one barrier before; any number of workgroups from one up
#include "bvh/lbvh.glsl"

void main() {
    PoolState pool = PoolState(state_address);
    PoolCursor cursor = pool_start();
    uint sorted = PHASES_BEFORE_SORT + PHASES_OF_A_PASS * passes;
    // Every round takes a ticket; there are fewer than 2^32.
    while (true) {
        pool_take(pool, cursor);
        if (!cursor.working) break;
        if (cursor.phase == PHASE_BOUNDS) {
            lbvh_bounds(cursor.task);
        } else if (cursor.phase == PHASE_PLAN) {
            lbvh_plan();
        } else if (cursor.phase == PHASE_ENCODE) {
            lbvh_encode(cursor.task);
        } else if (cursor.phase < sorted) {
            uint pass = (cursor.phase - PHASES_BEFORE_SORT) / PHASES_OF_A_PASS;
            uint step = (cursor.phase - PHASES_BEFORE_SORT) % PHASES_OF_A_PASS;
            Radix r = lbvh_radix(pass);
            if (step == 0) radix_count(r, cursor.task);
            else if (step == 1) radix_scan(r, cursor.task);
            else radix_scatter(r, cursor.task);
        } else {
            lbvh_hierarchy(cursor.task);
        }
        pool_finish(pool);
    }
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) {
        Structure structure = Structure(structure_address);
        atomicOr(structure.header.status, STATUS_SPIN_RAN_OUT);
    }
}
