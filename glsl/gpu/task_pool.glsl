// The persistent task pool: many phases of tasks in one dispatch, with any number of workgroups from one up.
//
// A worker (a workgroup) draws a ticket; tickets count through the tasks of all phases in order. A task waits until all
// tasks of the phases before have finished, and only those: they are held by workgroups that drew earlier tickets, which
// therefore run already. So the pool needs what Vulkan calls occupancy-bound progress (a started workgroup goes on), which
// src/gpu/probe.rs tries at start-up; it never waits for a workgroup that has not started.
// (Mesa's BVH builder and GPURT draw tickets likewise.)
//
// The task count of a phase may be written by any task of an earlier phase: it is read when that phase is over.
//
//   state  zeroed but for `phases` and the counts known up front; src/gpu/task_pool.rs writes it
//   needs  one barrier before; the workgroup calls the functions together; any subgroup size
#ifndef HEDGEROW_GPU_TASK_POOL
#define HEDGEROW_GPU_TASK_POOL
#include "gpu/pass.glsl"

const uint POOL_PHASES_AT_MOST = 188;
const uint POOL_STATUS_SPIN_RAN_OUT = 1;
// Polls before a worker gives up and says so. A poll takes at least some tens of nanoseconds, with its pause hundreds: many
// seconds in all.
const uint POOL_SPINS = 1u << 26;
// Rounds that a worker pauses between two polls, at most.
const uint POOL_LONGEST_PAUSE = 64;

// Workers that wait poll `done`: it has a cache line of its own, of up to 128 bytes, so that neither drawing tickets nor reading counts
// waits for those who poll.
BUFFER PoolState {
    uint next;      // ticket to draw
    uint status;
    uint phases;
    uint room_before[29];
    uint done;      // tasks finished
    uint room_behind[31];
    uint tasks[POOL_PHASES_AT_MOST];
};
// Of a PoolState; the words of those members that a pass sets up one by one.
const uint POOL_WORDS = 64 + POOL_PHASES_AT_MOST;
const uint POOL_WORD_PHASES = 2;
const uint POOL_WORD_TASKS = 64;

// Where a worker is: its phase, the tickets before that phase, and its task in the phase.
struct PoolCursor {
    uint phase;
    uint base;
    uint task;
    bool working;
};

shared uint pool_shared_phase;
shared uint pool_shared_base;
shared uint pool_shared_task;
shared uint pool_shared_working;

// Passes time; the result depends on what was polled, so that no compiler leaves it out.
uint pool_pause(uint rounds, uint polled) {
    for (uint round = 0; round < rounds; ++round) polled = polled * 1664525u + 1013904223u;
    return polled;
}

// Waits until `target` tasks are done; false if the spin ran out here or elsewhere. Pauses double, so that a short wait ends at once,
// and in a long one few polls reach memory.
bool pool_wait(PoolState pool, uint target) {
    uint pause = 0;
    for (uint spin = 0; spin < POOL_SPINS; ++spin) {
        uint done = atomicLoad(pool.done, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
        if (done >= target) return true;
        if ((spin & 1023) == 1023
            && atomicLoad(pool.status, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed) != 0) return false;
        // A poll more or less says nothing.
        if (pool_pause(pause, done) == 0u) ++spin;
        pause = min(2u * pause + 1u, POOL_LONGEST_PAUSE);
    }
    atomicOr(pool.status, POOL_STATUS_SPIN_RAN_OUT);
    return false;
}

// A pool that has not begun, with phases that have no tasks yet; by one invocation.
void pool_reset(PoolState pool, uint phases) {
    pool.next = 0u;
    pool.done = 0u;
    pool.status = 0u;
    pool.phases = phases;
    for (uint i = 0; i < phases; ++i) pool.tasks[i] = 0u;
}

PoolCursor pool_start() {
    return PoolCursor(0, 0, 0, true);
}

// Draws the next task; `working` is false when there is none left.
void pool_take(PoolState pool, inout PoolCursor cursor) {
    barrier();   // the last task's use of shared memory is over
    if (gl_LocalInvocationIndex == 0) {
        uint ticket = atomicAdd(pool.next, 1);
        uint phase = cursor.phase;
        uint base = cursor.base;
        bool working = true;
        // At most one round a phase.
        for (uint round = 0; round <= POOL_PHASES_AT_MOST; ++round) {
            if (phase >= pool.phases) {
                working = false;
                break;
            }
            // The counts of this phase are known, and its input is there, when all before is done.
            if (!pool_wait(pool, base)) {
                working = false;
                break;
            }
            acquire_from_device();
            uint tasks = pool.tasks[phase];
            if (ticket - base < tasks) break;
            base += tasks;
            phase += 1;
        }
        pool_shared_phase = phase;
        pool_shared_base = base;
        pool_shared_task = ticket - base;
        pool_shared_working = working ? 1 : 0;
    }
    barrier();
    acquire_from_device();
    cursor = PoolCursor(pool_shared_phase, pool_shared_base, pool_shared_task, pool_shared_working != 0);
}

// Tells that the task is finished.
void pool_finish(PoolState pool) {
    release_to_device();
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        release_to_device();
        atomicAdd(pool.done, 1);
    }
}
#endif
