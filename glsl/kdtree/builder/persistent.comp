#version 460
// All phases of a kd-tree's build in one dispatch, from the task pool: see kdtree/builder.glsl for the phases' contracts.
//
// needs  the state as kdtree/builder/reset.comp writes it, and one barrier before; any number of workgroups from one up
#include "kdtree/phases.glsl"

void main() {
    PoolState pool = PoolState(state_address);
    PoolCursor cursor = pool_start();
    // Every round takes a ticket; there are fewer than 2^32.
    while (true) {
        pool_take(pool, cursor);
        if (!cursor.working) break;
        uint phase = cursor.phase, item = cursor.task;
        if (phase == PHASE_COUNT) kd_count(item);
        else if (phase == PHASE_PLAN) kd_plan();
        else if (phase == PHASE_RECORDS) kd_records(item);
        else if (phase == PHASE_ROOT) kd_root();
        else if (phase == PHASE_ORDER) kd_order_subtrees(item);
        else if (phase == PHASE_PLACE) kd_place(item);
        else kd_level(phase, item);
        pool_finish(pool);
    }
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) {
        KdStructure structure = KdStructure(structure_address);
        atomicOr(structure.header.status, STATUS_SPIN_RAN_OUT);
    }
}
