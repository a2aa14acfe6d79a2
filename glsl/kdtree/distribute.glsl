// The references of a task go to its children, or to its leaf; its node, and the tasks of the next level, are written: see
// kdtree/builder.glsl.
#ifndef HEDGEROW_KDTREE_DISTRIBUTE
#define HEDGEROW_KDTREE_DISTRIBUTE
#include "kdtree/classify.glsl"
#include "kdtree/scan.glsl"

Words leaf_references() {
    return Words(kd_references_at(structure_address, node_room));
}

// Whether what would have been split are leaves, for want of room.
bool has_ended(uint of_level) {
    return build_state().ended == of_level + 1u;
}

// Where the references of a leaf begin; `before` is of the tile of its task.
uint leaf_at(Sums before, KdTask t, uint of_level) {
    uint first = build_state().first_leaf[of_level] + before.leaf_references;
    return has_ended(of_level) ? first + before.split_references + t.cut : first + t.leaf;
}

// References that were classified go to those of the children, from `at` on.
void distribute_references(KdReferences from, KdReferences to, uint begin, uint end, uvec2 at) {
    Words sides = Words(build_state().sides);
    for (uint base = begin; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uint side = i < end ? sides.word[i] : 0u;
        uvec2 total, to_side = at + sum_before(uvec2(side & IS_LEFT, side >> 1 & 1u), total);
        if (side != 0u) {
            KdReference own = from.reference[i];
            if ((side & IS_LEFT) != 0u) to.reference[to_side.x] = own;
            if ((side & IS_RIGHT) != 0u) {
                uint waits = side >> 2;
                if (waits != 0u) {
                    own.lo = from.reference[waits - 1u].lo;
                    own.hi = from.reference[waits - 1u].hi;
                }
                to.reference[to_side.y] = own;
            }
        }
        at += total;
    }
}

void kd_distribute_chunk(uint chunk, uint of_level) {
    KdReferences from = references_of(of_level), to = references_of(of_level + 1u);
    uint number = task_of_chunk(of_level, chunk);
    KdTask t = tasks_of(of_level).task[number];
    uint begin = t.begin + (chunk - t.first_chunk) * CHUNK, end = min(begin + CHUNK, t.begin + t.count);
    Fate fate = fate_of(t, has_ended(of_level));
    if (!fate.is_split) {
        Words leaf = leaf_references();
        uint first = leaf_at(task_tiles().tile[number / TILE], t, of_level);
        for (uint i = begin + gl_LocalInvocationIndex; i < end; i += gl_WorkGroupSize.x) {
            leaf.word[first + (i - t.begin)] = from.reference[i].record;
        }
        return;
    }
    uint first = fate.before.x + fate.before.y;
    uvec2 at = uvec2(first, first + fate.sides.x) + sides_before(chunk) - fate.before;
    distribute_references(from, to, begin, end, at);
}

// Leaves of few references, an invocation each.
void write_small_leaf(KdTask t, uint first, uint of_level) {
    KdReferences from = references_of(of_level);
    for (uint k = 0; k < t.count; ++k) leaf_references().word[first + k] = from.reference[t.begin + k].record;
}

// The nodes of a tile of tasks, and their tasks of the next level.
void kd_write_tile(uint tile, uint of_level) {
    KdState state = build_state();
    KdTasks tasks = tasks_of(of_level);
    KdStructure structure = KdStructure(structure_address);
    Sums sums = task_tiles().tile[tile];
    bool level_ends = has_ended(of_level);
    uint end = min(tile * TILE + TILE, state.task_count[of_level]);
    uint first_node = state.first_node[of_level], next_node = state.first_node[min(of_level + 1u, LEVELS - 1u)];
    for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        KdTask t = tasks.task[min(i, end - 1u)];
        Fate fate = fate_of(t, level_ends);
        bool is_leaf = fate.is_leaf && i < end, is_split = fate.is_split && i < end;
        KdTask left = new_task(Box(t.lo, t.hi), 0u, 0u, t.depth + 1u), right = left;
        if (is_split) {
            Box left_cell, right_cell;
            half_cells(Box(t.lo, t.hi), t.split & 3u, t.plane, left_cell, right_cell);
            uint begin = fate.before.x + fate.before.y;
            left = new_task(left_cell, begin, fate.sides.x, t.depth + 1u);
            right = new_task(right_cell, begin + fate.sides.x, fate.sides.y, t.depth + 1u);
        }
        uint child = next_node + write_tasks(of_level + 1u, left, right, sums);
        if (is_split) {
            structure.nodes[first_node + i] = kd_inner(t.split & 3u, t.plane, child, fate.sides.x == 0u, fate.sides.y == 0u);
        } else if (is_leaf) {
            uint leaf = leaf_at(sums, t, of_level);
            structure.nodes[first_node + i] = kd_leaf(leaf, t.count);
            if ((t.split & LARGE) == 0u) write_small_leaf(t, leaf, of_level);
        }
    }
}

void kd_distribute(uint item, uint of_level) {
    uint chunks = build_state().chunk_count[of_level];
    if (item < chunks) kd_distribute_chunk(item, of_level);
    else kd_write_tile(item - chunks, of_level);
}
#endif
