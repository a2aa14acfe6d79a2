#version 460
// Sets the state up before a build: empty bounds, and the pool with the tasks of each phase; one workgroup.
//
// writes  state
// needs   one barrier after
#include "bvh/hlbvh.glsl"

void main() {
    reset_build(PHASES_BEHIND_SORT);
    barrier();
    // What is one task; the scan and the levels write how many those behind them have.
    PoolState pool = PoolState(scratch_address);
    if (gl_LocalInvocationIndex == 0u) pool.tasks[pool_phase(PHASE_SCAN)] = 1u;
    for (uint phase = PHASE_SPLIT + gl_LocalInvocationIndex; phase <= PHASE_WEIGH; phase += gl_WorkGroupSize.x) {
        pool.tasks[pool_phase(phase)] = 0u;
    }
}
