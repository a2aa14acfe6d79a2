// The phases of the PLOC build behind the sort, in the pool: begin, four a round, finish, three of the collapse.
#ifndef HEDGEROW_BVH_PLOC_PHASES
#define HEDGEROW_BVH_PLOC_PHASES
#include "bvh/encode.glsl"

// Rounds that are recorded: src/bvh/ploc.rs.
layout(constant_id = 8) const uint ROUNDS = 0;
const uint PHASES_OF_A_ROUND = 4;
const uint PHASES_BEHIND_SORT = 1 + PHASES_OF_A_ROUND * ROUNDS + 4;

const uint STEP_SEARCH = 0;
const uint STEP_COUNT = 1;
const uint STEP_SCAN = 2;
const uint STEP_MERGE = 3;
const uint STEP_BEGIN = 4;
const uint STEP_FINISH = 5;
const uint STEP_ABOVE = 6;
const uint STEP_PLACE = 7;
const uint STEP_RECORDS = 8;

// `phase` counts from the sort on.
uint step_of(uint phase) {
    if (phase == 0u) return STEP_BEGIN;
    uint of_rounds = phase - 1u;
    if (of_rounds < PHASES_OF_A_ROUND * ROUNDS) return of_rounds % PHASES_OF_A_ROUND;
    return STEP_FINISH + of_rounds - PHASES_OF_A_ROUND * ROUNDS;
}

uint round_of(uint phase) {
    return (phase - 1u) / PHASES_OF_A_ROUND;
}
#endif
