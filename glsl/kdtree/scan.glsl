// The end of a level: where chunks put what they have, whether there is room for the next level, its nodes and tasks. See
// kdtree/builder.glsl. What a task makes is summed up first, a tile of tasks at a time; when the sums of all tiles are known, each
// tile is written to its places.
#ifndef HEDGEROW_KDTREE_SCAN
#define HEDGEROW_KDTREE_SCAN
#include "kdtree/heuristic.glsl"

// ---- chunks ----

// Replaces a number of pairs, from one on, by the sums of those before. Returns the sum of all.
uvec2 scan_pairs(KdSides pairs, uint begin, uint end) {
    uvec2 sum = uvec2(0);
    for (uint base = begin; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uvec2 own = i < end ? pairs.side[i] : uvec2(0), total;
        uvec2 before = sum_before(own, total);
        if (i < end) pairs.side[i] = sum + before;
        sum += total;
    }
    return sum;
}

// Of tiles of primitives, which are chunks of one task, at once; the sum of all lies behind.
uvec2 scan_chunks(uint chunks) {
    KdSides sides = chunk_sides();
    uvec2 sum = scan_pairs(sides, 0u, chunks);
    if (gl_LocalInvocationIndex == 0u) sides.side[chunks] = sum;
    return sum;
}

// References on the left and on the right of all chunks of the level before this one.
uvec2 sides_before(uint chunk) {
    return chunk_tiles().side[chunk / TILE] + chunk_sides().side[chunk];
}

// A chunk is classified. The last of a tile scans that, the last tile of the level the tiles; whether this was the last.
bool kd_sum_chunk(uint chunk, uint of_level) {
    KdState state = build_state();
    KdSides tiles = chunk_tiles();
    Words arrivals = Words(state.arrivals);
    uint chunks = state.chunk_count[of_level];
    uint tile = chunk / TILE, begin = tile * TILE, end = min(begin + TILE, chunks), arrived = 0;
    release_workgroup();
    if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(arrivals.word[tile], 1u);
    if (!is_last_of(arrived, end - begin)) return false;
    uvec2 sum = scan_pairs(chunk_sides(), begin, end);
    if (gl_LocalInvocationIndex == 0u) {
        arrivals.word[tile] = 0u;
        tiles.side[tile] = sum;
        // Behind all chunks: a tile of its own where the last one is full.
        if (end == chunks) chunk_sides().side[chunks] = chunks % TILE == 0u ? uvec2(0) : sum;
    }
    release_workgroup();
    if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(state.classified[of_level], 1u);
    if (!is_last_of(arrived, tiles_of(chunks))) return false;
    uvec2 all = scan_pairs(tiles, 0u, tiles_of(chunks));
    if (gl_LocalInvocationIndex == 0u) tiles.side[tiles_of(chunks)] = all;
    next_phase();
    return true;
}

// ---- tasks ----

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
        fate.before = sides_before(t.first_chunk);
        fate.sides = sides_before(t.first_chunk + chunks_of(t.count)) - fate.before;
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
    return KdTask(cell.lo, begin, cell.hi, count, depth, 0u, NONE, split, 0.0, 0u, 0u);
}

uint chunks_of_task(uint count) {
    return is_large_task(count) ? chunks_of(count) : 0u;
}

bool wants_counters(uint count, uint depth) {
    return !ends_by_rule(count, depth) && chunks_of_task(count) > 1u;
}

Sums no_sums() {
    return Sums(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
}

// Adds a task of the next level with this many references, if there are any.
void add_task(inout Sums sums, uint count, uint depth) {
    sums.tasks += count > 0u ? 1u : 0u;
    sums.chunks += chunks_of_task(count);
    sums.subtrees += is_subtree(count, depth) ? 1u : 0u;
    sums.counters += wants_counters(count, depth) ? 1u : 0u;
    sums.subtree_references += is_subtree(count, depth) ? count : 0u;
}

// Adds what all invocations have of something; returns what those before have, behind what there was.
uint add_all(inout uint sum, uint own) {
    uint total, before = sum + sum_before(own, total);
    sum += total;
    return before;
}

// The same of two things.
uvec2 add_all(inout uvec2 sum, uvec2 own) {
    uvec2 total, before = sum + sum_before(own, total);
    sum += total;
    return before;
}

// Three numbers of up to 512 each in a word: what tasks of a tile make is summed up in few words, as each sum is much code.
uint packed(uint a, uint b, uint c) {
    return a | b << 10 | c << 20;
}

uvec3 unpacked(uint word) {
    return uvec3(word & 1023u, word >> 10 & 1023u, word >> 20);
}

// Adds what the invocations of a workgroup have of tasks, of up to 512, and of the leaves and splits that they are of.
void add_all_tasks(inout Sums sums, Sums own) {
    uint kinds = packed(own.tasks, own.subtrees, own.counters), fates = packed(own.leaves, own.inner, 0u);
    uvec4 all;
    sum_before(uvec4(kinds, fates, own.chunks, own.subtree_references), all);
    uvec3 of_kind = unpacked(all.x), of_fate = unpacked(all.y);
    sums.tasks += of_kind.x;
    sums.subtrees += of_kind.y;
    sums.counters += of_kind.z;
    sums.chunks += all.z;
    sums.subtree_references += all.w;
    sums.leaves += of_fate.x;
    sums.inner += of_fate.y;
}

// Sums up what the tasks of a tile make if the level is split, and where their leaves are in the tile.
void kd_sum_tile(uint tile, uint of_level) {
    KdTasks tasks = tasks_of(of_level);
    Sums own = no_sums(), sums = no_sums();
    uint end = min(tile * TILE + TILE, build_state().task_count[of_level]);
    // References of leaves, and of all that is cut.
    uvec2 all = uvec2(0);
    for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        KdTask t = tasks.task[min(i, end - 1u)];
        Fate fate = fate_of(t, false);
        bool is_leaf = fate.is_leaf && i < end, is_split = fate.is_split && i < end;
        if (is_split) {
            own.inner += 1u;
            add_task(own, fate.sides.x, t.depth + 1u);
            add_task(own, fate.sides.y, t.depth + 1u);
        }
        own.leaves += is_leaf ? 1u : 0u;
        uvec2 before = add_all(all, uvec2(is_leaf ? t.count : 0u, is_leaf || is_split ? t.count : 0u));
        if (is_leaf || is_split) {
            tasks.task[i].leaf = before.x;
            tasks.task[i].cut = before.y;
        }
    }
    add_all_tasks(sums, own);
    sums.leaf_references = all.x;
    sums.split_references = all.y - all.x;
    if (gl_LocalInvocationIndex == 0u) task_tiles().tile[tile] = sums;
}

// Replaces words, a stride apart, by the sums of those before. The sum of all lies behind.
void scan_words(Words words, uint first, uint stride, uint count) {
    uint sum = 0;
    for (uint base = 0; base < count; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uint before = add_all(sum, i < count ? words.word[first + stride * i] : 0u);
        if (i < count) words.word[first + stride * i] = before;
    }
    if (gl_LocalInvocationIndex == 0u) words.word[first + stride * count] = sum;
}

// Replaces the sums of tiles by those of all tiles before. Returns the sums of all.
Sums scan_tiles(uint tiles) {
    const uint WORDS = SUMS_BYTES / 4u;
    // The address is loaded before the loop. Mesa 26's lavapipe runs the loads of a loop even if no lane is in it, and then loaded this
    // one from address 0.
    KdSums sums = task_tiles();
    Words words = Words(uvec2(sums));
    for (uint word = 0; word < WORDS; ++word) scan_words(words, word, WORDS, tiles);
    next_phase();
    return sums.tile[tiles];
}

// Whether there is room for what a level makes, and for this many references in the next. Records what was needed. By one invocation.
bool has_room(uint of_level, Sums sums, uint references) {
    KdState state = build_state();
    uint with_parts = state.level_references[of_level] + state.straddling[of_level];
    uint cut = state.leaf_count + state.root_references + sums.leaf_references + references;
    uint nodes = state.node_count + sums.tasks, all_subtrees = state.subtree_count + sums.subtrees;
    state.most_references = max(state.most_references, max(references, with_parts));
    state.most_cut = max(state.most_cut, cut);
    state.most_nodes = max(state.most_nodes, nodes);
    state.most_subtrees = max(state.most_subtrees, all_subtrees);
    return references <= reference_capacity && cut <= cut_room && nodes <= level_node_room && sums.tasks <= task_capacity
        && all_subtrees <= subtree_capacity && state.is_short == 0u;
}

// Makes known what a level has; by one invocation.
void publish_level(uint of_level, Sums sums, uint references) {
    KdState state = build_state();
    PoolState pool = PoolState(state_address);
    if (of_level >= LEVELS) return;
    state.task_count[of_level] = sums.tasks;
    state.chunk_count[of_level] = sums.chunks;
    state.level_references[of_level] = references;
    state.first_node[of_level] = state.node_count;
    state.first_subtree[of_level] = state.subtree_count;
    state.first_leaf[of_level] = state.leaf_count;
    state.node_count += sums.tasks;
    state.subtree_count += sums.subtrees;
    state.root_references += sums.subtree_references;
    state.binned_chunks[of_level] = sums.counters > 0u ? sums.chunks : 0u;
    uint phase = bin_phase(of_level);
    pool.tasks[phase] = state.binned_chunks[of_level] + sums.subtrees;
    pool.tasks[phase + 1u] = sums.tasks > 0u ? max(sums.chunks, 1u) : 0u;
    pool.tasks[phase + 2u] = sums.chunks + tiles_of(sums.tasks);
    pool.tasks[PHASE_ORDER] = max(tiles_of(state.subtree_count), 1u);
}

// The sums of all tiles of a level are there: what the next one has. By one workgroup.
void kd_end_level(uint of_level) {
    KdState state = build_state();
    Sums sums = scan_tiles(tiles_of(state.task_count[of_level]));
    if (gl_LocalInvocationIndex != 0u) return;
    uint chunks = state.chunk_count[of_level];
    uvec2 sides = chunks > 0u ? sides_before(chunks) : uvec2(0);
    uint references = sides.x + sides.y;
    bool fits = has_room(of_level, sums, references);
    // Without room for the next level there is none: what would have been split becomes leaves.
    if (references > 0u && !fits) {
        state.status |= STATUS_OUT_OF_ROOM;
        state.ended = of_level + 1u;
        state.leaf_count += sums.leaf_references + sums.split_references;
        state.leaves += sums.leaves + sums.inner;
        sums = no_sums();
        references = 0u;
    } else {
        state.leaf_count += sums.leaf_references;
        state.leaves += sums.leaves;
        state.inner_nodes += sums.inner;
        state.empty_leaves += 2u * sums.inner - sums.tasks;
    }
    publish_level(of_level + 1u, sums, references);
}

// All of it by one workgroup.
void kd_scan(uint of_level) {
    uint tiles = tiles_of(build_state().task_count[of_level]);
    for (uint tile = 0; tile < tiles; ++tile) kd_sum_tile(tile, of_level);
    next_phase();
    kd_end_level(of_level);
}

// The last tile of a level ends it.
void kd_scan_tile(uint tile, uint of_level) {
    KdState state = build_state();
    kd_sum_tile(tile, of_level);
    release_workgroup();
    uint arrived = 0;
    if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(state.scanned[of_level], 1u);
    if (is_last_of(arrived, tiles_of(state.task_count[of_level]))) kd_end_level(of_level);
}

// Writes as many as two tasks an invocation, in the order of the invocations, behind what `sums` says of the level; returns which
// of the level the first one is.
uint write_tasks(uint of_level, KdTask left, KdTask right, inout Sums sums) {
    KdTasks tasks = tasks_of(of_level);
    KdSubtrees subtrees = all_subtrees();
    KdState state = build_state();
    KdTask both[2] = KdTask[2](left, right);
    Sums own = no_sums();
    add_task(own, left.count, left.depth);
    add_task(own, right.count, right.depth);
    // What is packed, and chunks.
    uvec2 all, all_before = sum_before(uvec2(packed(own.tasks, own.subtrees, own.counters), own.chunks), all);
    uvec3 before = unpacked(all_before.x), of_all = unpacked(all.x);
    uint first = sums.tasks + before.x, at = first;
    uint small = sums.subtrees + before.y, counter = sums.counters + before.z, chunk = sums.chunks + all_before.y;
    sums.tasks += of_all.x;
    sums.subtrees += of_all.y;
    sums.counters += of_all.z;
    sums.chunks += all.y;
    uint first_node = state.first_node[min(of_level, LEVELS - 1u)];
    small += state.first_subtree[min(of_level, LEVELS - 1u)];
    uint deepest = subgroupMax(max(left.count > 0u ? left.depth : 0u, right.count > 0u ? right.depth : 0u));
    if (subgroupElect()) atomicMax(state.depth, deepest);
    for (uint side = 0; side < 2u; ++side) {
        KdTask t = both[0];
        if (side == 1u) t = both[1];
        if (t.count > 0u) {
            t.first_chunk = chunk;
            if (wants_counters(t.count, t.depth)) {
                t.counters = counter;
                counter += 1u;
            }
            if (is_subtree(t.count, t.depth)) {
                subtrees.subtree[small].node = first_node + at;
                subtrees.subtree[small].task = at;
                small += 1u;
            }
            tasks.task[at] = t;
            at += 1u;
            chunk += chunks_of_task(t.count);
        }
    }
    return first;
}
#endif
