#version 460
// All steps of objects' trees down the static one, and what is met there, in one dispatch from the task pool. See kdtree/merge.glsl.
//
// needs  the state as merge_plan.comp leaves it, and one barrier before; any number of workgroups from one up
#include "kdtree/merge/push.glsl"

void main() {
    PoolState pool = PoolState(state_address);
    PoolCursor cursor = pool_start();
    // Every round takes a ticket; there are fewer than 2^32.
    while (true) {
        pool_take(pool, cursor);
        if (!cursor.working) break;
        if (cursor.phase < PUSH_STEPS) kd_push(cursor.task, cursor.phase);
        else kd_meet(cursor.task);
        pool_finish(pool);
    }
    KdMerge merge = merge_state();
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) atomicOr(merge.status, STATUS_SPIN_RAN_OUT);
}
