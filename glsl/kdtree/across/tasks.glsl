// The tasks of a build across levels: a cell of more than EXACT references is binned, classified and distributed, one of fewer is built
// to its leaves. The phases are those of kdtree/builder.glsl, of one task each: the references of a child are in the same order, and its
// tree has the same bytes, whatever else is built meanwhile.
#ifndef HEDGEROW_KDTREE_ACROSS_TASKS
#define HEDGEROW_KDTREE_ACROSS_TASKS
#include "kdtree/across/memory.glsl"
#include "kdtree/across/pool.glsl"
#include "kdtree/distribute.glsl"
#include "kdtree/small.glsl"

const uint TO_BIN = 0;
const uint TO_CLASSIFY = 1;
const uint TO_DISTRIBUTE = 2;
const uint TO_BUILD = 3;
const uint TO_END = 4;       // it is a leaf

// Chunks of a task that one worker does by itself: its references are in its caches, and nothing of it goes through memory.
const uint ALONE = 2;

struct KdCellTask {
    vec3 lo;
    uint begin;             // its references in the arena, and the size of their piece
    vec3 hi;
    uint count;
    uint room;
    uint spare;             // its second piece: those of its children go there
    uint spare_room;
    uint phase;
    uint depth;
    uint draft;
    uint axis;
    float plane;
    uint left;              // references on either side
    uint right;
    uint right_at;          // where the right child's piece begins in the second
    uint last_wait;         // parts on the right wait there and before
    uint waiting;           // how many do
    uint children;          // their drafts
    uint counters;          // of a task that workers share: its counters, then the sides of its chunks; otherwise NONE
    uint counters_room;
};

const uint CELL_TASK_BYTES = 96;
// Tasks of its own that a worker has at most, one a level: a ring.
const uint OWN_TASKS = 64;

BUFFER KdCellTasks { KdCellTask task[]; };

// ---- the worker ----

uint own_first = 0;
uint own_count = 0;
// Whether it counts as alive.
bool is_alive = false;
// Inner nodes, leaves, empty leaves: outside of subtrees, and in them.
uvec3 own_tallies = uvec3(0);
uvec3 own_subtree_tallies = uvec3(0);
uvec3 own_subtrees = uvec3(0);   // how many, their nodes, their references
uint own_depth = 0;
// Pieces that the task at hand needs no more: where they begin, and their size. They are given back at one place, as drivers take long
// to compile each copy of what does it.
uvec2 done_with[2] = uvec2[2](uvec2(0), uvec2(0));

ChunkPool chunk_pool() {
    return ChunkPool(across_state().pool);
}

KdCellTasks slot_tasks() {
    return KdCellTasks(across_state().tasks);
}

KdCellTasks own_tasks() {
    return KdCellTasks(address_of(across_state().own, group_number(), OWN_TASKS * CELL_TASK_BYTES));
}

// The worker keeps a task for later.
void push_task(KdCellTask t) {
    uint at = (own_first + own_count) % OWN_TASKS;
    if (gl_LocalInvocationIndex == 0u) own_tasks().task[at] = t;
    own_count += 1u;
}

KdCellTask pop_task() {
    own_count -= 1u;
    next_phase();
    KdCellTask t = own_tasks().task[(own_first + own_count) % OWN_TASKS];
    barrier();
    return t;
}

void count_alive(uint more) {
    if (gl_LocalInvocationIndex == 0u) atomicAdd(chunk_pool().alive, more);
}

// A task that is the worker's own from now on was in a slot, or was made by what was; the slot is free.
void leave_slot(uint slot) {
    chunk_pool_free(chunk_pool(), slot);
    // What counted as alive was the slot.
    if (is_alive) count_alive(NONE);
    is_alive = true;
}

// Puts the task that has waited longest, which is the largest, where others find it.
void offer_task() {
    uint idle = 0;
    if (gl_LocalInvocationIndex == 0u) {
        idle = atomicLoad(chunk_pool().idle, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
    }
    if (agree(idle) == 0u) return;
    uint slot = chunk_pool_slot(chunk_pool());
    if (slot == NONE) return;
    next_phase();
    if (gl_LocalInvocationIndex == 0u) slot_tasks().task[slot] = own_tasks().task[own_first % OWN_TASKS];
    own_first = (own_first + 1u) % OWN_TASKS;
    own_count -= 1u;
    count_alive(1u);
    chunk_pool_publish(chunk_pool(), slot, 1u, 0u);
}

// ---- tasks that workers share ----

KdSides sides_of_chunks(KdCellTask t) {
    return KdSides(address_of(arena_at(t.counters), COUNTERS, 4u));
}

// Puts a task of many chunks where all workers find it, if there is memory for its counters, and a slot.
bool share_task(KdCellTask t) {
    uint chunks = chunks_of(t.count);
    t.counters_room = pieces_of_words(COUNTERS + 2u * (chunks + 1u));
    t.counters = take_piece(t.counters_room);
    if (t.counters == NONE) return false;
    uint slot = chunk_pool_slot(chunk_pool());
    if (slot == NONE) {
        give_piece(t.counters, t.counters_room);
        return false;
    }
    Words all = Words(arena_at(t.counters));
    for (uint c = gl_LocalInvocationIndex; c < COUNTERS; c += gl_WorkGroupSize.x) all.word[c] = 0u;
    if (gl_LocalInvocationIndex == 0u) slot_tasks().task[slot] = t;
    count_alive(1u);
    chunk_pool_publish(chunk_pool(), slot, chunks, 0u);
    return true;
}

// ---- leaves and subtrees ----

void make_leaf(KdCellTask t) {
    if (gl_LocalInvocationIndex == 0u) {
        drafts().draft[t.draft] = KdDraft(DRAFT_LEAF, t.begin, t.count, KdNode(0u, 0u), 0u, 0u);
    }
    own_tallies.y += 1u;
    done_with = uvec2[2](uvec2(t.begin + t.count, t.room - t.count), uvec2(t.spare, t.spare_room));
}

// False if there is no room for it.
bool build_subtree(KdCellTask t) {
    KdStack stack = stack_of(group_number());
    KdBuilt built = build_small(arena(), t.begin, t.count, Box(t.lo, t.hi), t.depth, stack);
    uint at = NONE;
    bool fits = take_room(built.nodes, built.references - t.count);
    if (fits) {
        at = take_to_keep(pieces_of_words(2u * built.nodes + built.references));
        if (at == NONE) give_room(built.nodes, built.references - t.count);
    }
    if (at == NONE) return false;
    KdNodes nodes = KdNodes(arena_at(at));
    Words references = Words(address_of(arena_at(at), built.nodes, 8u));
    for (uint i = gl_LocalInvocationIndex; i < built.nodes; i += gl_WorkGroupSize.x) nodes.node[i] = stack.nodes.node[1u + i];
    for (uint i = gl_LocalInvocationIndex; i < built.references; i += gl_WorkGroupSize.x) {
        references.word[i] = stack.leaves.word[i];
    }
    if (gl_LocalInvocationIndex == 0u) {
        uint count = built.nodes | built.references << 8;
        drafts().draft[t.draft] = KdDraft(DRAFT_SUBTREE, at, count, stack.nodes.node[0], 0u, 0u);
    }
    own_subtree_tallies += built.tallies;
    own_subtrees += uvec3(1u, built.nodes, built.references);
    own_depth = max(own_depth, built.deepest);
    done_with = uvec2[2](uvec2(t.begin, t.room), uvec2(t.spare, t.spare_room));
    next_phase();
    return true;
}

// ---- phases ----

// The faces of a number of references in bins: all of a task's, or a chunk, added to the counters that are shared.
void bin_references(KdCellTask t, uint begin, uint end, bool is_shared) {
    fill_bins(arena(), Box(t.lo, t.hi), begin, end);
    if (!is_shared) return;
    Words all = Words(arena_at(t.counters));
    for (uint c = gl_LocalInvocationIndex; c < COUNTERS; c += gl_WorkGroupSize.x) {
        if (counters[c] != 0u) atomicAdd(all.word[c], counters[c]);
    }
}

// Boxes on either side of the plane, by the bins.
uvec2 boxes_beside(KdCellTask t) {
    uint bins = planes_not_beyond(planes_of(Box(t.lo, t.hi), t.axis), t.plane), first = 2u * BINS * t.axis;
    uvec2 own = uvec2(0), all;
    for (uint bin = gl_LocalInvocationIndex; bin < bins; bin += gl_WorkGroupSize.x) {
        own += uvec2(counters[first + bin], counters[first + BINS + bin]);
    }
    sum_before(own, all);
    return uvec2(all.x, t.count - all.y);
}

// Chooses the plane by the bins, and makes room for the children. False if the task is a leaf.
bool choose_plane(inout KdCellTask t, bool is_shared) {
    if (is_shared) {
        Words all = Words(arena_at(t.counters));
        for (uint c = gl_LocalInvocationIndex; c < COUNTERS; c += gl_WorkGroupSize.x) counters[c] = all.word[c];
        barrier();
    }
    Box cell = Box(t.lo, t.hi);
    float area_scale = build_state().area_scale;
    KdPlane best = best_of_bins(cell, area_scale, t.count);
    if (best.cost == INFINITE || !pays(best.cost, cell, area_scale, t.count)) return false;
    t.axis = best.axis;
    t.plane = float_of_ordered(best.place);
    // Parts on the right wait behind the references of the children: as many as there are boxes on both sides.
    uvec2 beside = boxes_beside(t);
    uint straddlers = beside.x + beside.y - t.count, needed = beside.x + beside.y + straddlers;
    if (t.spare_room < needed) {
        give_piece(t.spare, t.spare_room);
        t.spare_room = needed;
        t.spare = take_piece_or_less(t.spare_room, needed / 8u);
        if (t.spare == NONE) {
            t.spare_room = 0u;
            return false;
        }
    }
    t.last_wait = t.spare + t.spare_room - 1u;
    t.waiting = 0u;
    t.phase = TO_CLASSIFY;
    return true;
}

// The sides of a number of references: how many are on the left and on the right.
uvec2 classify_references(inout KdCellTask t, uint begin, uint end, uint slot) {
    uvec2 found = uvec2(0), all;
    for (uint block = begin; block < end; block += BLOCK) {
        uint straddlers = list_straddling(arena(), block, min(block + BLOCK, end), t.axis, t.plane, true, found);
        if (straddlers == 0u) continue;
        uint first = t.waiting;
        if (slot == NONE) {
            t.waiting += straddlers;
        } else {
            if (gl_LocalInvocationIndex == 0u) first = atomicAdd(slot_tasks().task[slot].waiting, straddlers);
            first = agree(first);
        }
        clip_straddling(arena(), straddlers, t.last_wait - first, true, Box(t.lo, t.hi), t.axis, t.plane, found);
    }
    sum_before(found, all);
    return all;
}

// So much of a whole as `part` is of `all`.
uint share_of(uint whole, uint part, uint all) {
    return part == all ? whole : min(uint(float(whole) * (float(part) / float(all))), whole);
}

// The task is classified: its children have these numbers of references. False if there is no room for them.
bool place_children(inout KdCellTask t, uvec2 sides) {
    uint children = (sides.x > 0u ? 1u : 0u) + (sides.y > 0u ? 1u : 0u), all = sides.x + sides.y;
    if (!take_room(children, all - t.count)) return false;
    t.children = take_to_keep(children);
    if (t.children == NONE) {
        give_room(children, all - t.count);
        return false;
    }
    t.left = sides.x;
    t.right = sides.y;
    // Until all are distributed, what waits is in the way.
    uint more = t.spare_room - min(t.spare_room, t.waiting + all);
    t.right_at = t.spare + (sides.y == 0u ? t.spare_room : sides.x + share_of(more, sides.x, all));
    t.phase = TO_DISTRIBUTE;
    if (gl_LocalInvocationIndex == 0u) {
        uint empty = (sides.x == 0u ? DRAFT_LEFT_EMPTY : 0u) | (sides.y == 0u ? DRAFT_RIGHT_EMPTY : 0u);
        uint kind = DRAFT_INNER | t.axis << 2 | empty;
        drafts().draft[t.draft] = KdDraft(kind, t.children, floatBitsToUint(t.plane), KdNode(0u, 0u), 0u, 0u);
    }
    own_tallies += uvec3(1u, 0u, 2u - children);
    return true;
}

// A child goes where it is built; it is a leaf where the rule has it so.
void begin_task(KdCellTask t) {
    own_depth = max(own_depth, t.depth);
    t.phase = ends_by_rule(t.count, t.depth) ? TO_END : t.count > EXACT ? TO_BIN : TO_BUILD;
    if (t.phase == TO_BIN && chunks_of(t.count) > ALONE && share_task(t)) return;
    push_task(t);
}

// The references are with the children: these begin, the left one behind the right one, and is done first.
void begin_children(KdCellTask t) {
    Box halves[2];
    half_cells(Box(t.lo, t.hi), t.axis, t.plane, halves[0], halves[1]);
    // What the task itself had is their second piece.
    uint second = share_of(t.room, t.left, t.left + t.right);
    for (uint k = 0; k < 2u; ++k) {
        bool is_left = k == 1u;
        KdCellTask child = t;
        Box half_cell = halves[1];
        if (is_left) half_cell = halves[0];
        child.lo = half_cell.lo;
        child.hi = half_cell.hi;
        child.count = is_left ? t.left : t.right;
        child.begin = is_left ? t.spare : t.right_at;
        child.room = is_left ? t.right_at - t.spare : t.spare + t.spare_room - t.right_at;
        child.spare = is_left ? t.begin : t.begin + second;
        child.spare_room = is_left ? second : t.room - second;
        child.draft = is_left || t.left == 0u ? t.children : t.children + 1u;
        child.depth = t.depth + 1u;
        child.counters = NONE;
        child.counters_room = 0u;
        if (child.count > 0u) begin_task(child);
    }
    if (own_count > 1u) offer_task();
}
#endif
