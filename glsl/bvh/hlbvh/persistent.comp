#version 460
#define HEDGEROW_BUILD_BY_ONE_DISPATCH
// All phases of the HLBVH build in one dispatch, from the task pool: see bvh/hlbvh.glsl for the phases' contracts.
//
// needs  the state as bvh/hlbvh/reset.comp writes it, and one barrier before; any number of workgroups from one up
#include "bvh/hlbvh/treelets.glsl"
#include "bvh/hlbvh/split.glsl"
#include "bvh/collapse.glsl"

void hlbvh_from_pool(uint phase, uint task) {
    if (phase == PHASE_TREELETS) hlbvh_treelets(task);
    else if (phase == PHASE_COUNT) hlbvh_count(task);
    else if (phase == PHASE_SCAN) hlbvh_scan();
    else if (phase == PHASE_GATHER) hlbvh_gather(task);
    else if (phase <= PHASE_FINISH) hlbvh_split(task, phase - PHASE_SPLIT, phase == PHASE_FINISH);
    else if (phase == PHASE_WEIGH) hlbvh_weigh(task);
    else if (phase == PHASE_ABOVE) collapse_above(task);
    else if (phase == PHASE_PLACE) collapse_place(task);
    else collapse_records(task);
}

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
        else hlbvh_from_pool(cursor.phase - sorted, cursor.task);
        pool_finish(pool);
    }
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) {
        Structure structure = Structure(structure_address);
        atomicOr(structure.header.status, STATUS_SPIN_RAN_OUT);
    }
}
