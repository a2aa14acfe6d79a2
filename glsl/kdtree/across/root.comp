#version 460
// The root's task, in the first slot; one workgroup. See kdtree/across/tasks.glsl.
//
// reads   the references of the root, at the beginning of the arena, and what kdtree/encode.glsl says of them
#include "kdtree/across/tasks.glsl"
#include "kdtree/encode.glsl"

void main() {
    KdAcross across = across_state();
    Box cell = root_cell();
    uint count = build_state().active_count;
    if (count == 0u) return;
    if (gl_LocalInvocationIndex == 0u) {
        // Its draft is behind its references.
        across.arena_used = count + 1u;
        across.node_count = 1u;
        across.reference_count = count;
    }
    clear_pieces();
    next_phase();
    KdCellTask t;
    t.lo = cell.lo;
    t.hi = cell.hi;
    t.begin = 0u;
    t.count = count;
    t.room = count;
    t.spare = 0u;
    t.spare_room = 0u;
    t.phase = TO_BIN;
    t.depth = 0u;
    t.draft = count;
    t.axis = 0u;
    t.plane = 0.0;
    t.left = 0u;
    t.right = 0u;
    t.right_at = 0u;
    t.last_wait = 0u;
    t.waiting = 0u;
    t.children = 0u;
    t.counters = NONE;
    t.counters_room = 0u;
    is_alive = true;
    if (gl_LocalInvocationIndex == 0u) chunk_pool().alive = 0u;
    begin_task(t);
    // Shared.
    if (own_count == 0u) return;
    uint slot = chunk_pool_slot(chunk_pool());
    next_phase();
    if (gl_LocalInvocationIndex == 0u) slot_tasks().task[slot] = own_tasks().task[0];
    count_alive(1u);
    chunk_pool_publish(chunk_pool(), slot, 1u, 0u);
}
