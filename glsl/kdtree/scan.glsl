// The end of a level, by one workgroup: where chunks put what they have, the nodes, and the tasks of the next level. See
// kdtree/build.glsl.
#ifndef HEDGEROW_KDTREE_SCAN
#define HEDGEROW_KDTREE_SCAN
#include "kdtree/heuristic.glsl"

// Makes of the sides of each chunk those of all chunks before; the sum of all lies behind.
uvec2 scan_chunks(uint chunks) {
    KdSides sides = chunk_sides();
    uvec2 sum = uvec2(0);
    for (uint base = 0; base < chunks; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uvec2 own = i < chunks ? sides.side[i] : uvec2(0), total;
        uvec2 before = uvec2(sum_before(own.x, total.x), sum_before(own.y, total.y));
        if (i < chunks) sides.side[i] = sum + before;
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u) sides.side[chunks] = sum;
    return sum;
}

// What becomes of a task.
struct Fate {
    bool is_leaf;
    bool is_split;
    uvec2 sides;       // references on the left and on the right
    uvec2 before;      // of all tasks before
};

Fate fate_of(KdTask t, bool level_ends) {
    Fate fate = Fate(false, false, uvec2(0), uvec2(0));
    bool is_large = (t.split & LARGE) != 0u;
    fate.is_split = is_large && !level_ends && (t.split & SPLIT) != 0u;
    fate.is_leaf = is_large ? !fate.is_split : (t.split & ENDS) != 0u;
    if (fate.is_split) {
        KdSides sides = chunk_sides();
        fate.before = sides.side[t.first_chunk];
        fate.sides = sides.side[t.first_chunk + chunks_of(t.count)] - fate.before;
    }
    return fate;
}

bool is_subtree(uint count, uint depth) {
    return count > 0u && count <= EXACT && !ends_by_rule(count, depth);
}

bool is_large_task(uint count) {
    return count > EXACT;
}

// A task of a level with what it is by its number of references.
KdTask new_task(Box cell, uint begin, uint count, uint depth) {
    bool ends = ends_by_rule(count, depth);
    uint split = (is_large_task(count) ? LARGE : 0u) | (ends ? ENDS : 0u);
    return KdTask(cell.lo, begin, cell.hi, count, depth, 0u, NONE, split, 0.0, 0u, 0u, 0u);
}

uint chunks_of_task(KdTask t) {
    return (t.split & LARGE) != 0u ? chunks_of(t.count) : 0u;
}

bool wants_counters(KdTask t) {
    return (t.split & ENDS) == 0u && chunks_of_task(t) > 1u;
}

// What the next level has so far.
struct Sums {
    uint tasks;
    uint chunks;
    uint subtrees;
    uint subtree_references;
    uint counters;
};

// Writes as many as two tasks an invocation, in the order of the invocations.
void write_tasks(uint of_level, KdTask left, KdTask right, inout Sums sums) {
    KdTasks tasks = tasks_of(of_level);
    KdSubtrees subtrees = all_subtrees();
    KdTask both[2] = KdTask[2](left, right);
    uvec2 is_there = uvec2(left.count > 0u ? 1u : 0u, right.count > 0u ? 1u : 0u);
    uvec2 chunks = uvec2(chunks_of_task(left), chunks_of_task(right));
    uvec2 is_small = uvec2(is_subtree(left.count, left.depth) ? 1u : 0u, is_subtree(right.count, right.depth) ? 1u : 0u);
    uvec2 wants = uvec2(wants_counters(left) ? 1u : 0u, wants_counters(right) ? 1u : 0u);
    Sums total;
    uint at = sums.tasks + sum_before(is_there.x + is_there.y, total.tasks);
    uint chunk = sums.chunks + sum_before(chunks.x + chunks.y, total.chunks);
    uint small = sums.subtrees + sum_before(is_small.x + is_small.y, total.subtrees);
    uint counter = sums.counters + sum_before(wants.x + wants.y, total.counters);
    sum_before(is_small.x * left.count + is_small.y * right.count, total.subtree_references);
    uint first_node = build_state().node_count;
    uint deepest = subgroupMax(max(is_there.x * left.depth, is_there.y * right.depth));
    if (subgroupElect()) atomicMax(build_state().depth, deepest);
    for (uint side = 0; side < 2u; ++side) {
        KdTask t = both[0];
        if (side == 1u) t = both[1];
        if (is_there[side] == 1u) {
            t.first_chunk = chunk;
            if (wants[side] == 1u) t.counters = counter;
            if (is_small[side] == 1u) {
                subtrees.subtree[small].node = first_node + at;
                subtrees.subtree[small].task = at;
            }
            tasks.task[at] = t;
            at += 1u;
            chunk += chunks[side];
            small += is_small[side];
            counter += wants[side];
        }
    }
    sums.tasks += total.tasks;
    sums.chunks += total.chunks;
    sums.subtrees += total.subtrees;
    sums.subtree_references += total.subtree_references;
    sums.counters += total.counters;
}

// Makes known what a level has.
void publish_level(uint of_level, Sums sums, uint references) {
    KdState state = build_state();
    PoolState pool = PoolState(state_address);
    if (gl_LocalInvocationIndex != 0u || of_level >= LEVELS) return;
    uint first_node = state.node_count, first_subtree = state.subtree_count;
    state.task_count[of_level] = sums.tasks;
    state.chunk_count[of_level] = sums.chunks;
    state.level_references[of_level] = references;
    state.first_node[of_level] = first_node;
    state.first_subtree[of_level] = first_subtree;
    state.node_count = first_node + sums.tasks;
    state.subtree_count = sums.subtrees;
    state.root_references += sums.subtree_references;
    state.binned_chunks[of_level] = sums.counters > 0u ? sums.chunks : 0u;
    uint phase = bin_phase(of_level);
    pool.tasks[phase] = state.binned_chunks[of_level] + sums.subtrees - first_subtree;
    pool.tasks[phase + 1u] = sums.tasks > 0u ? max(sums.chunks, 1u) : 0u;
    pool.tasks[phase + 2u] = sums.chunks + (sums.tasks + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
}

// What a level would add to leaves, nodes and subtrees.
bool has_room(uint of_level, uint references) {
    KdState state = build_state();
    KdTasks tasks = tasks_of(of_level);
    uint count = state.task_count[of_level];
    uint in_leaves = 0, children = 0, small = 0;
    for (uint i = gl_LocalInvocationIndex; i < count; i += gl_WorkGroupSize.x) {
        Fate fate = fate_of(tasks.task[i], false);
        if (fate.is_leaf) in_leaves += tasks.task[i].count;
        if (fate.is_split) {
            uint depth = tasks.task[i].depth + 1u;
            children += (fate.sides.x > 0u ? 1u : 0u) + (fate.sides.y > 0u ? 1u : 0u);
            small += (is_subtree(fate.sides.x, depth) ? 1u : 0u) + (is_subtree(fate.sides.y, depth) ? 1u : 0u);
        }
    }
    uint all_in_leaves, all_children, all_small;
    sum_before(in_leaves, all_in_leaves);
    sum_before(children, all_children);
    sum_before(small, all_small);
    uint cut = state.leaf_count + state.root_references + all_in_leaves + references;
    uint nodes = state.node_count + all_children, subtrees = state.subtree_count + all_small;
    if (gl_LocalInvocationIndex == 0u) {
        uint with_parts = state.level_references[of_level] + state.straddling[of_level];
        state.most_references = max(state.most_references, max(references, with_parts));
        state.most_cut = max(state.most_cut, cut);
        state.most_nodes = max(state.most_nodes, nodes);
        state.most_subtrees = max(state.most_subtrees, subtrees);
    }
    return references <= reference_capacity && cut <= cut_room && nodes <= level_node_room && all_children <= task_capacity
        && subtrees <= subtree_capacity;
}

void kd_scan(uint of_level) {
    KdState state = build_state();
    KdTasks tasks = tasks_of(of_level);
    KdStructure structure = KdStructure(structure_address);
    uint count = state.task_count[of_level];
    uvec2 moved = scan_chunks(state.chunk_count[of_level]);
    next_step();
    uint references = moved.x + moved.y;
    bool fits = has_room(of_level, references) && state.is_short == 0u;
    bool splits = references > 0u;
    // Where there is no room for the next level, there is none: what would have been split are leaves.
    bool level_ends = splits && !fits;
    if (level_ends && gl_LocalInvocationIndex == 0u) {
        state.status |= STATUS_OUT_OF_ROOM;
        state.ended = of_level + 1u;
    }
    uint first_node = state.first_node[of_level], next_node = state.node_count;
    uint leaf_at = state.leaf_count, inner_nodes = 0, leaves = 0, empty_leaves = 0;
    Sums sums = Sums(0u, 0u, state.subtree_count, 0u, 0u);
    for (uint base = 0; base < count; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        bool is_task = i < count;
        KdTask t = tasks.task[min(i, count - 1u)];
        Fate fate = fate_of(t, level_ends);
        fate.is_leaf = fate.is_leaf && is_task;
        fate.is_split = fate.is_split && is_task;
        uint in_leaves, total;
        uint leaf = leaf_at + sum_before(fate.is_leaf ? t.count : 0u, in_leaves);
        uint children = fate.is_split ? (fate.sides.x > 0u ? 1u : 0u) + (fate.sides.y > 0u ? 1u : 0u) : 0u;
        uint first_child = next_node + sums.tasks + sum_before(children, total);
        KdTask left = new_task(Box(t.lo, t.hi), 0u, 0u, t.depth + 1u), right = left;
        if (fate.is_split) {
            uint axis = t.split & 3u;
            Box left_cell, right_cell;
            half_cells(Box(t.lo, t.hi), axis, t.plane, left_cell, right_cell);
            uint begin = fate.before.x + fate.before.y;
            left = new_task(left_cell, begin, fate.sides.x, t.depth + 1u);
            right = new_task(right_cell, begin + fate.sides.x, fate.sides.y, t.depth + 1u);
            tasks.task[i].left = begin;
            tasks.task[i].right = begin + fate.sides.x;
            structure.nodes[first_node + i] = kd_inner(axis, t.plane, first_child, fate.sides.x == 0u, fate.sides.y == 0u);
        } else if (fate.is_leaf) {
            tasks.task[i].leaf = leaf;
            tasks.task[i].split = t.split & ~SPLIT;
            structure.nodes[first_node + i] = kd_leaf(leaf, t.count);
        }
        write_tasks(of_level + 1u, left, right, sums);
        leaf_at += in_leaves;
        sum_before(fate.is_split ? 1u : 0u, total);
        inner_nodes += total;
        sum_before(fate.is_split ? 2u - children : 0u, total);
        empty_leaves += total;
        sum_before(fate.is_leaf ? 1u : 0u, total);
        leaves += total;
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        state.leaf_count = leaf_at;
        state.inner_nodes += inner_nodes;
        state.leaves += leaves;
        state.empty_leaves += empty_leaves;
    }
    publish_level(of_level + 1u, sums, level_ends ? 0u : references);
}
#endif
