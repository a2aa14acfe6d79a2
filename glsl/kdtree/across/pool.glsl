// A task pool in which tasks of all levels run at once: Papay 2025, sections 7.2 and 9.3, algorithms 6 and 7.
//
// A task lies in a *slot*. The slot's *header* is how many chunks of the task's phase nobody has taken yet; beside it is how many are
// not finished. A worker (a workgroup) looks through the headers for one that is positive, and takes a chunk by an atomic subtraction.
// Whoever finishes the last chunk of a phase gives the task its next phase, or makes its children. A worker keeps what it has made,
// and looks for nothing, as long as it can.
//
// It needs what gpu/task_pool.glsl needs: a workgroup that has started goes on. No worker waits for another to start: one ends as soon
// as nothing is *alive*, which is a slot in use or a worker with tasks of its own. (The thesis counts working subgroups, all of them
// from the start on; one that has not started would be waited for.) Spins are bounded.
//
//   state  zeroed but for `slots`, a multiple of the workgroup's size
//   needs  the workgroup calls the functions together, with the same arguments; any subgroup size
#ifndef HEDGEROW_KDTREE_ACROSS_POOL
#define HEDGEROW_KDTREE_ACROSS_POOL
#include "kdtree/builder.glsl"

// Searches that find nothing, one after the other, before a worker gives up and says so: many seconds.
const uint CHUNK_POOL_SPINS = 1u << 24;

// What waiting workers poll has a cache line of its own.
BUFFER ChunkPool {
    uint alive;      // slots in use, and workers with tasks of their own
    uint status;
    uint room_before[30];
    uint in_use;     // slots
    uint used;       // all slots that were in use lie before this one
    uint hint;       // no slot before this one is free, as far as anybody knows
    uint idle;       // workers that search and find nothing
    uint slots;
    uint room_behind[27];
    int header[];    // of each slot; behind all of them chunks that are not finished, of each; then whether it is taken, of each
};

const uint CHUNK_POOL_BYTES = 256;
const uint SLOT_BYTES = 12;

shared uint pool_found;
shared uint pool_found_chunk;

// Looks through the slots once, as many at a time as there are lanes: algorithm 7, lines 7 to 35. Workers begin at different slots when
// many are in use, and at the front when few are. Whether there was a chunk.
bool chunk_pool_search(ChunkPool pool, uint worker, uint workers, out uint slot, out uint chunk) {
    const uint LANES = gl_WorkGroupSize.x;
    // How many slots are in use, and how many have been.
    uvec2 own = uvec2(0);
    if (gl_LocalInvocationIndex == 0u) {
        own.x = atomicLoad(pool.in_use, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
        own.y = atomicLoad(pool.used, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
    }
    uvec2 slots = agree(own);
    uint in_use = slots.x, end = (slots.y + LANES - 1u) / LANES * LANES;
    slot = 0u;
    chunk = 0u;
    if (end == 0u) return false;
    uint start = in_use / workers * worker % end, start_lane = worker % LANES;
    start -= start % LANES;
    for (uint at = 0; at < end; at += LANES) {
        uint i = start + at < end ? start + at : start + at - end;
        i += gl_LocalInvocationIndex;
        int chunks = atomicLoad(pool.header[i], gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
        uint turn = chunks > 0 ? (gl_LocalInvocationIndex + LANES - start_lane) % LANES : NONE;
        for (uint tries = 0; tries < LANES; ++tries) {
            uint first = least_of_all(turn);
            if (first == NONE) break;
            if (turn == first) {
                int before = atomicAdd(pool.header[i], -1);
                pool_found = before > 0 ? i : NONE;
                pool_found_chunk = uint(before - 1);
                turn = NONE;
            }
            barrier();
            uint found = pool_found, found_chunk = pool_found_chunk;
            barrier();
            if (found != NONE) {
                acquire_from_device();
                slot = found;
                chunk = found_chunk;
                return true;
            }
        }
    }
    return false;
}

// Searches until there is a chunk, or nothing is alive any more: false then, or if the spin ran out here or elsewhere.
bool chunk_pool_take(ChunkPool pool, uint worker, uint workers, out uint slot, out uint chunk) {
    bool is_idle = false;
    uint pause = 0;
    for (uint spin = 0; spin < CHUNK_POOL_SPINS; ++spin) {
        if (chunk_pool_search(pool, worker, workers, slot, chunk)) {
            if (is_idle && gl_LocalInvocationIndex == 0u) atomicAdd(pool.idle, NONE);
            return true;
        }
        uint goes_on = 0;
        if (gl_LocalInvocationIndex == 0u) {
            if (!is_idle) atomicAdd(pool.idle, 1u);
            uint alive = atomicLoad(pool.alive, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
            uint status = atomicLoad(pool.status, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
            // Never NONE: a pause cannot be left out.
            if (alive != 0u && status == 0u) goes_on = pool_pause(pause, alive) | 1u;
        }
        is_idle = true;
        if (agree(goes_on) == 0u) return false;
        pause = min(2u * pause + 1u, POOL_LONGEST_PAUSE);
    }
    if (gl_LocalInvocationIndex == 0u) atomicOr(pool.status, POOL_STATUS_SPIN_RAN_OUT);
    return false;
}

// A slot that was free, or NONE if all are in use.
uint chunk_pool_slot(ChunkPool pool) {
    const uint LANES = gl_WorkGroupSize.x;
    uint slots = pool.slots, own_hint = 0;
    if (gl_LocalInvocationIndex == 0u) {
        own_hint = atomicLoad(pool.hint, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
    }
    uint start = min(agree(own_hint), slots - 1u);
    start -= start % LANES;
    for (uint at = 0; at < slots; at += LANES) {
        uint i = start + at < slots ? start + at : start + at - slots;
        i += gl_LocalInvocationIndex;
        int taken = atomicLoad(pool.header[2u * slots + i], gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
        uint turn = taken == 0 ? gl_LocalInvocationIndex : NONE;
        for (uint tries = 0; tries < LANES; ++tries) {
            uint first = least_of_all(turn);
            if (first == NONE) break;
            if (turn == first) {
                pool_found = atomicCompSwap(pool.header[2u * slots + i], 0, 1) == 0 ? i : NONE;
                turn = NONE;
            }
            barrier();
            uint found = pool_found;
            barrier();
            if (found != NONE) {
                if (gl_LocalInvocationIndex == 0u) {
                    atomicStore(pool.hint, found + 1u, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
                    atomicMax(pool.used, found + 1u);
                    atomicAdd(pool.in_use, 1u);
                }
                acquire_from_device();
                return found;
            }
        }
    }
    return NONE;
}

// The slot is free again.
void chunk_pool_free(ChunkPool pool, uint slot) {
    release_workgroup();
    if (gl_LocalInvocationIndex == 0u) {
        atomicAdd(pool.in_use, NONE);
        atomicExchange(pool.header[2u * pool.slots + slot], 0);
        atomicMin(pool.hint, slot);
    }
}

// Makes a phase of the task in the slot known, of this many chunks; the last of them may be the worker's own already.
void chunk_pool_publish(ChunkPool pool, uint slot, uint chunks, uint of_worker) {
    release_workgroup();
    if (gl_LocalInvocationIndex == 0u) {
        atomicExchange(pool.header[pool.slots + slot], int(chunks));
        release_to_device();
        atomicExchange(pool.header[slot], int(chunks - of_worker));
    }
    barrier();
}

// Tells that a chunk is finished; whether it was the last one of the phase.
bool chunk_pool_finish(ChunkPool pool, uint slot) {
    release_workgroup();
    int before = 0;
    if (gl_LocalInvocationIndex == 0u) before = atomicAdd(pool.header[pool.slots + slot], -1);
    acquire_from_device();
    bool was_last = agree(uint(before)) == 1u;
    acquire_from_device();
    return was_last;
}
#endif
