#version 460
// The nodes of a build across levels to their places, level by level, in one dispatch: see kdtree/across/place.glsl.
//
// reads   the drafts
// writes  the structure but for its records, and the report
// needs   one barrier before; any number of workgroups from one up; a workgroup that has started goes on
#include "kdtree/across/place.glsl"

void main() {
    PoolState pool = PoolState(state_address);
    PoolCursor cursor = pool_start();
    // Every round takes a ticket; there are fewer than 2^32.
    while (true) {
        pool_take(pool, cursor);
        if (!cursor.working) break;
        uint of_level = cursor.phase / 2u;
        if (cursor.phase % 2u == 0u) kd_sum_drafts(cursor.task, of_level);
        else kd_write_drafts(cursor.task, of_level);
        pool_finish(pool);
    }
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) {
        KdStructure structure = KdStructure(structure_address);
        atomicOr(structure.header.status, STATUS_SPIN_RAN_OUT);
    }
}
