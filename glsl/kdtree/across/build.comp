#version 460
// The task pool of a build across levels: Papay 2025, algorithm 6. See kdtree/across/pool.glsl and kdtree/across/tasks.glsl.
//
// reads   the root's task in the pool, the references of the root
// writes  the drafts of all nodes, and what there is of each kind
// needs   one barrier before; any number of workgroups from one up; a workgroup that has started goes on
#include "kdtree/across/tasks.glsl"

// A round makes a step of a task: there are fewer.
const uint ROUNDS = 0xFFFFFFF0u;

// What the worker has counted.
void add_up(uint retrievals, uint skipped) {
    if (gl_LocalInvocationIndex != 0u) return;
    KdState state = build_state();
    KdAcross across = across_state();
    atomicAdd(across.retrievals, retrievals);
    atomicAdd(across.skipped, skipped);
    atomicAdd(state.inner_nodes, own_tallies.x);
    atomicAdd(state.leaves, own_tallies.y);
    atomicAdd(state.empty_leaves, own_tallies.z);
    atomicAdd(state.subtree_inner, own_subtree_tallies.x);
    atomicAdd(state.subtree_leaves, own_subtree_tallies.y);
    atomicAdd(state.subtree_empty, own_subtree_tallies.z);
    atomicAdd(across.subtree_count, own_subtrees.x);
    atomicAdd(state.subtree_nodes, own_subtrees.y);
    atomicAdd(state.subtree_references, own_subtrees.z);
    atomicMax(state.depth, own_depth);
}

void main() {
    ChunkPool pool = chunk_pool();
    uint worker = group_number(), workers = gl_NumWorkGroups.x * gl_NumWorkGroups.y;
    uint retrievals = 0, skipped = 0, slot = NONE, chunk = 0;
    bool has_task = false;
    KdCellTask t;
    clear_pieces();
    for (uint round = 0; round < ROUNDS; ++round) {
        if (has_task) {
            skipped += 1u;
        } else if (own_count > 0u) {
            t = pop_task();
            slot = NONE;
            skipped += 1u;
        } else {
            if (is_alive) count_alive(NONE);
            is_alive = false;
            if (!chunk_pool_take(pool, worker, workers, slot, chunk)) break;
            retrievals += 1u;
            t = slot_tasks().task[slot];
            if (t.counters == NONE) {
                leave_slot(slot);
                slot = NONE;
            }
        }
        has_task = false;
        bool is_shared = slot != NONE, is_leaf = t.phase == TO_END, is_built = false;
        if (t.phase == TO_BUILD) {
            is_built = build_subtree(t);
            is_leaf = !is_built;
        } else if (!is_leaf) {
            uint begin = t.begin, end = t.begin + t.count;
            uvec2 sides = uvec2(0);
            if (is_shared) {
                begin += chunk * CHUNK;
                end = min(begin + CHUNK, end);
            }
            if (t.phase == TO_BIN) {
                bin_references(t, begin, end, is_shared);
            } else if (t.phase == TO_CLASSIFY) {
                sides = classify_references(t, begin, end, slot);
                if (is_shared && gl_LocalInvocationIndex == 0u) sides_of_chunks(t).side[chunk] = sides;
            } else {
                uvec2 before = uvec2(0);
                if (is_shared) before = sides_of_chunks(t).side[chunk];
                distribute_references(arena(), arena(), begin, end, uvec2(t.spare, t.right_at) + before);
            }
            next_phase();
            if (is_shared && !chunk_pool_finish(pool, slot)) continue;

            // The phase is over: what comes next. (The thesis' post-processing.)
            uint phase = t.phase, chunks = chunks_of(t.count);
            if (phase == TO_BIN) {
                is_leaf = !choose_plane(t, is_shared);
            } else if (phase == TO_CLASSIFY) {
                if (is_shared) {
                    sides = scan_pairs(sides_of_chunks(t), 0u, chunks);
                    t.waiting = slot_tasks().task[slot].waiting;
                }
                is_leaf = !place_children(t, sides);
            }
            has_task = phase != TO_DISTRIBUTE && !is_leaf;
            next_phase();
            if (has_task && is_shared) {
                // The last chunk of the next phase is the worker's own.
                chunk = chunks - 1u;
                if (gl_LocalInvocationIndex == 0u) slot_tasks().task[slot] = t;
                chunk_pool_publish(pool, slot, chunks, 1u);
            }
            if (has_task) continue;
        }
        if (is_leaf) make_leaf(t);
        else if (!is_built) begin_children(t);
        [[dont_unroll]] for (uint k = 0; k < 3u; ++k) {
            uvec2 piece = k == 0u ? done_with[0] : k == 1u ? done_with[1] : uvec2(t.counters, is_shared ? t.counters_room : 0u);
            give_piece(piece.x, piece.y);
        }
        done_with = uvec2[2](uvec2(0), uvec2(0));
        if (is_shared) leave_slot(slot);
    }
    add_up(retrievals, skipped);
}
