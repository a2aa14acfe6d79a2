#version 460
// Sets the state up before a build: empty bounds, and the pool with the tasks of each phase; one workgroup.
//
// writes  state
// needs   one barrier after
#include "bvh/lbvh.glsl"

void main() {
    LbvhState state = LbvhState(state_address);
    uint i = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1) / tile;
    uint columns_a_task = PRIVATE_COUNTERS ? gl_WorkGroupSize.x : 1;
    uint column_tasks = (columns + columns_a_task - 1) / columns_a_task;
    uint scan_tasks = (DIGITS + columns_a_task - 1) / columns_a_task;
    uint phases = PHASES_BEFORE_SORT + PHASES_OF_A_PASS * passes + 1;
    for (uint word = i; word < 4 + POOL_PHASES_AT_MOST; word += gl_WorkGroupSize.x) {
        uint phase = word - 4;
        uint value = 0;
        if (word == 3) value = phases;
        if (word >= 4 && phase < phases) {
            uint step = (phase - PHASES_BEFORE_SORT) % PHASES_OF_A_PASS;
            if (phase == PHASE_PLAN) value = 1;
            else if (phase < PHASES_BEFORE_SORT || phase == phases - 1) value = tiles;
            else value = step == 1 ? scan_tasks : column_tasks;
        }
        state.pool[word] = value;
    }
    for (uint axis = i; axis < 3; axis += gl_WorkGroupSize.x) {
        state.boxes_lo[axis] = NONE;
        state.boxes_hi[axis] = 0;
        state.centroids_lo[axis] = NONE;
        state.centroids_hi[axis] = 0;
    }
    if (i == 0) {
        state.active_count = 0;
        state.status = 0;
    }
}
