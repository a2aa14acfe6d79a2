#version 460
// Sets the state of a build across levels up, and says where things lie: src/kdtree/across.rs adds up the same. Workgroups share the
// slots. See kdtree/across/pool.glsl.
//
// writes  the state, and what is zero of the pool
#include "kdtree/across/tasks.glsl"
#include "kdtree/across/place.glsl"
#include "kdtree/encode.glsl"

// Of these arguments, a build across levels takes others than one by levels: `reference_capacity` is the arena's, `task_capacity` the
// number of slots, `subtree_capacity` that of workers.
void main() {
    KdState state = build_state();
    KdAcross across = across_state();
    uvec2 pool = address_of(address_of(state_address, 1u, STATE_BYTES), 1u, ACROSS_BYTES);
    ChunkPool slots = ChunkPool(pool);
    for (uint i = invocation_number(); i < 3u * task_capacity; i += gl_NumWorkGroups.x * gl_WorkGroupSize.x) slots.header[i] = 0;
    if (invocation_number() != 0u) return;
    slots.alive = 0u;
    slots.status = 0u;
    slots.in_use = 0u;
    slots.used = 0u;
    slots.hint = 0u;
    slots.idle = 0u;
    slots.slots = task_capacity;
    across.pool = pool;
    uvec2 at = address_of(address_of(pool, 1u, CHUNK_POOL_BYTES), task_capacity, SLOT_BYTES);
    across.tasks = at;
    at = address_of(at, task_capacity, CELL_TASK_BYTES);
    across.own = at;
    at = address_of(at, subtree_capacity, OWN_TASKS * CELL_TASK_BYTES);
    state.stacks = at;
    at = address_of(at, subtree_capacity, STACK_BYTES);
    across.tiles = at;
    at = address_of(at, tiles_of(reference_capacity) + 1u, TILE_BYTES);
    // Sides are of the references of a task, of its chunks before there is one, and at last where the drafts of all levels are named.
    state.sides = at;
    state.chunks = at;
    at = address_of(at, reference_capacity, 4u);
    state.references[0] = at;
    state.references[1] = at;
    state.counters = uvec2(0);
    across.node_count = 0u;
    across.reference_count = 0u;
    across.subtree_count = 0u;
    across.is_short = 0u;
    across.retrievals = 0u;
    across.skipped = 0u;
    across.arena_used = 0u;
    for (uint i = 0; i < LEVELS; ++i) across.scanned[i] = 0u;
    across.before[0] = uvec4(0);
    clear_state();
    PoolState places = PoolState(state_address);
    pool_reset(places, PLACE_PHASES);
    places.tasks[0] = 1u;
}
