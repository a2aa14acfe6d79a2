#version 460
// Builds the marked leaves again and puts them into their places in one dispatch, from the task pool. See kdtree/merge.glsl.
//
// needs  the state as merge_tasks.comp leaves it, and one barrier before; any number of workgroups from one up
#include "kdtree/phases.glsl"
#include "kdtree/merge/build.glsl"

void main() {
    PoolState pool = PoolState(state_address);
    PoolCursor cursor = pool_start();
    // Every round takes a ticket; there are fewer than 2^32.
    while (true) {
        pool_take(pool, cursor);
        if (!cursor.working) break;
        uint phase = cursor.phase, item = cursor.task;
        if (phase == PHASE_GATHER) kd_gather(item);
        else if (phase == PHASE_ORDER) kd_order_merged(item);
        else if (phase == PHASE_PLACE) kd_place(item);
        else if (phase == PHASE_HOOK) kd_hook(item);
        else kd_level(phase, item);
        pool_finish(pool);
    }
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) {
        KdMerge merge = merge_state();
        KdStructure structure = KdStructure(structure_address);
        atomicOr(merge.status, STATUS_SPIN_RAN_OUT);
        atomicOr(structure.header.status, STATUS_SPIN_RAN_OUT);
    }
}
