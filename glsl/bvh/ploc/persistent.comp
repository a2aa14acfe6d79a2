#version 460
#define HEDGEROW_BUILD_BY_ONE_DISPATCH
// All phases of the PLOC build in one dispatch, from the task pool: see bvh/ploc.glsl for the phases' contracts.
//
// needs  the state as bvh/ploc/reset.comp writes it, and one barrier before; any number of workgroups from one up
#include "bvh/ploc.glsl"
#include "bvh/ploc/phases.glsl"
#include "bvh/collapse.glsl"

// The tasks of the phases behind a scan.
void tell_tasks(PoolState pool, uint phase) {
    if (gl_LocalInvocationIndex != 0u) return;
    uint round = round_of(phase - phases_before_hierarchy());
    pool.tasks[phase + 1u] = tiles_of(clusters_in(round));
    if (round + 1u < ROUNDS) {
        uint tiles = tiles_of(clusters_in(round + 1u));
        pool.tasks[phase + 2u] = tiles;
        pool.tasks[phase + 3u] = tiles;
    }
}

void ploc_from_pool(PoolState pool, uint phase, uint task) {
    uint behind = phase - phases_before_hierarchy();
    uint step = step_of(behind);
    if (step == STEP_BEGIN) {
        ploc_begin(task);
    } else if (step == STEP_SEARCH) {
        ploc_search(task, round_of(behind));
    } else if (step == STEP_COUNT) {
        ploc_count(task, round_of(behind));
    } else if (step == STEP_SCAN) {
        ploc_scan(round_of(behind));
        tell_tasks(pool, phase);
    } else if (step == STEP_MERGE) {
        ploc_merge(task, round_of(behind));
    } else if (step == STEP_FINISH) {
        ploc_finish(ROUNDS);
    } else if (step == STEP_ABOVE) {
        collapse_above(task);
    } else if (step == STEP_PLACE) {
        collapse_place(task);
    } else {
        collapse_records(task);
    }
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
        else ploc_from_pool(pool, cursor.phase, cursor.task);
        pool_finish(pool);
    }
    if (gl_LocalInvocationIndex == 0 && pool.status != 0) {
        Structure structure = Structure(structure_address);
        atomicOr(structure.header.status, STATUS_SPIN_RAN_OUT);
    }
}
