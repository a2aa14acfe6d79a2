#version 460
// Sets the state up before a build: empty bounds, and the pool with the tasks of each phase; one workgroup.
//
// writes  state
// needs   one barrier after
#include "bvh/ploc/phases.glsl"

void main() {
    reset_build(PHASES_BEHIND_SORT);
    barrier();
    // What is one task; the scans write how many the others have from the first round on.
    PoolState pool = PoolState(scratch_address);
    uint sorted = phases_before_hierarchy();
    for (uint phase = gl_LocalInvocationIndex; phase < PHASES_BEHIND_SORT; phase += gl_WorkGroupSize.x) {
        if (step_of(phase) == STEP_SCAN || step_of(phase) == STEP_FINISH) pool.tasks[sorted + phase] = 1;
    }
}
