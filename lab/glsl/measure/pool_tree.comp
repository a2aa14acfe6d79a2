#version 460
// Probe of the task pool: a tree of tasks that grows phase by phase, every count written by the phase before, as data-dependent
// work does. src/gpu/probe.rs runs it at start-up and in the tests, and holds the twin.
//
// Task t of phase p counts itself at visits[first of p + t] and reads what its parent t / 2 of phase p - 1 left there: a worker
// that runs ahead of its inputs finds none and leaves a wrong number.
//
// writes  visits, the pool
// needs   the pool zeroed, with one task in phase 0; visits zeroed; any number of workgroups from one up
#include "gpu/task_pool.glsl"

layout(push_constant, scalar) uniform PoolTreeArguments {
    PoolState pool;
    Words visits;
    Words loops;        // [0]: what a long loop counted to
    uint loop_length;
};

void main() {
    PoolCursor cursor = pool_start();
    while (true) {
        pool_take(pool, cursor);
        if (!cursor.working) break;
        uint first = (1u << cursor.phase) - 1;
        if (gl_LocalInvocationIndex == 0) {
            uint parent = cursor.phase == 0 ? 1 : visits.word[first / 2 + cursor.task / 2];
            visits.word[first + cursor.task] += parent + 1;
            // The next phase has two tasks for each of this one's; all write the same number.
            if (cursor.phase + 1 < pool.phases) pool.tasks[cursor.phase + 1] = 2u << cursor.phase;
        }
        pool_finish(pool);
    }
    // Some drivers end long loops early, without a word.
    if (invocation_number() == 0) {
        uint counted = 0;
        for (uint i = 0; i < loop_length; ++i) counted += visits.word[0] == 0 ? 0 : 1;
        loops.word[0] = counted;
    }
}
