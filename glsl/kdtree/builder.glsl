// What the phases of a kd-tree's build share: the arguments, the state, where things lie. src/kdtree/builder.rs records the phases,
// src/kdtree/host is the twin, bit for bit.
//
// The tree is built level by level. A *task* is a node of the level with its references; a task of more than EXACT references is
// *large* and cut into *chunks*, a workgroup's worth of references each. Phases of a level:
//
//     bin         each chunk of a large task counts the faces in bins; the last of a task chooses the plane.
//                 Each task of no more than EXACT references is built to its leaves by one workgroup.
//     classify    each chunk finds the sides of its references and clips what straddles the plane; where chunks put what they have
//                 is summed up on the way.
//     scan        how many nodes, leaves and tasks of the next level those of the level before them make; a workgroup a tile of tasks.
//                 In the pool the last chunk of the level does it, without a phase of its own.
//     distribute  each chunk moves its references to the next level, or to its leaf; each tile writes its nodes, and its tasks of the
//                 next level.
//
// A large task of one chunk is binned and its plane chosen when it is classified: its references are loaded by one workgroup anyway.
//
// Sums over a level are made in two steps, without waiting: a workgroup scans a *tile* of TILE items by itself, and the last tile to
// arrive scans the tiles. A position is then that of the tile and that in the tile.
//
//   needs  one barrier between phases; subgroups of any size; workgroups of any size, the same in all kernels but those of subtrees,
//          their places and gathering (build_subtrees, build_place, merge_gather), of which one subgroup has most to do
#ifndef HEDGEROW_KDTREE_BUILD
#define HEDGEROW_KDTREE_BUILD
#include "gpu/pass.glsl"
#include "gpu/task_pool.glsl"
#include "kdtree/layout.glsl"
#include "bvh/primitives.glsl"
#include "bvh/sah.glsl"

// References of an invocation in a chunk.
layout(constant_id = 1) const uint ITEMS = 1;
layout(constant_id = 2) const uint BINS = 2;
// References up to which a task is built by one workgroup, every plane looked at.
layout(constant_id = 3) const uint EXACT = 1;

const uint NONE = 0xFFFFFFFFu;
// Items whose sums one workgroup makes: chunks, tasks or subtrees.
const uint TILE = 256;
const uint LEVELS = KD_MAX_DEPTH + 1;
const uint CHUNK = ITEMS * gl_WorkGroupSize.x;

// A primitive in a cell: the box of its part there.
struct KdReference {
    vec3 lo;
    uint record;
    vec3 hi;
};

const uint SPLIT_LEFT_PLANAR = 4;   // what lies in the plane is on its left; the axis is in the lowest bits
const uint SPLIT = 8;
const uint LARGE = 16;              // has chunks
const uint ENDS = 32;               // is a leaf, whatever a split would cost

struct KdTask {
    vec3 lo;
    uint begin;
    vec3 hi;
    uint count;
    uint depth;
    uint first_chunk;
    uint counters;                  // those of a task of several chunks; otherwise NONE
    uint split;
    float plane;
    uint leaf;                      // where its references begin, of those of leaves of its tile
    uint cut;                       // the same if nothing of the level is split
};

// A subtree that one workgroup builds: the node of its root, where the others and the references wait, and where they go.
struct KdSubtree {
    uint node;
    uint task;                      // in its level
    KdNode root;
    uint nodes_at;
    uint nodes;
    uint references_at;
    uint references;
    uint first_node;                // of those of its tile
    uint first_reference;
};

// What tasks make, or all tasks of the tiles before.
struct Sums {
    uint tasks;                     // of the next level
    uint chunks;
    uint subtrees;
    uint counters;
    uint subtree_references;
    uint leaf_references;
    uint split_references;          // of what is split
    uint leaves;
    uint inner;
};

const uint TASK_BYTES = 60;
const uint SUBTREE_BYTES = 40;
const uint SUMS_BYTES = 36;
// Of the state, with room to spare, and of what a merge adds to it: kdtree/merge/state.glsl.
const uint STATE_BYTES = 3584;

BUFFER KdReferences { KdReference reference[]; };
BUFFER KdTasks { KdTask task[]; };
BUFFER KdSubtrees { KdSubtree subtree[]; };
BUFFER KdNodes { KdNode node[]; };
BUFFER KdSums { Sums tile[]; };
// Of a chunk, references on the left and on the right: as many as it has, then as many as those before it in its tile have. Of a tile
// of chunks the same, and of a tile of subtrees their nodes and references.
BUFFER KdSides { uvec2 side[]; };

// What a build needed: `Report` in src/kdtree/builder.rs.
struct KdReport {
    uint status;
    uint level_references;
    uint level_nodes;
    uint subtree_nodes;
    uint cut_references;
    uint subtree_references;
    uint subtrees;
    uint ended;                     // at this level and one for want of room: what was needed below is not known
    uint arena;                     // references that the arena had room for and that were in use, of a build across levels
    uint retrievals;                // tasks and chunks that workers took out of a pool
    uint skipped;                   // steps of a task that its worker went on with
};

BUFFER KdState {
    uint pool[POOL_WORDS];          // a PoolState
    KdReport report;
    uvec2 references[2];
    uvec2 tasks[2];
    uvec2 subtrees;
    uvec2 chunks;
    uvec2 sides;
    uvec2 counters;
    uvec2 arrivals;                 // chunks of a tile that were classified; behind the counters
    uvec2 chunk_tiles;
    uvec2 task_tiles;
    uvec2 subtree_tiles;
    uvec2 nodes;                    // of subtrees
    uvec2 leaf_references;          // of subtrees
    uvec2 stacks;
    uint octaves[2];                // sum over triangles, low word first
    uint triangles_with_octave;
    uint longest;
    uint active_count;
    uint status;
    uint lo[3];                     // `ordered` floats
    uint hi[3];
    vec3 cell_lo;
    vec3 cell_hi;
    float reach;
    float area_scale;
    uint task_count[LEVELS];
    uint chunk_count[LEVELS];
    uint first_node[LEVELS];
    uint first_subtree[LEVELS];
    uint level_references[LEVELS];
    uint binned_chunks[LEVELS];     // as many as chunks if any task has several, otherwise none
    uint classified[LEVELS];        // tiles of chunks
    uint scanned[LEVELS];           // tiles of tasks
    uint ordered;                   // tiles of subtrees
    uint straddling[LEVELS];
    uint first_leaf[LEVELS];        // references of leaves of the levels before
    uint node_count;                // of all levels so far
    uint subtree_count;
    uint leaf_count;                // references of their leaves, those of subtrees apart
    uint root_references;           // of the roots of all subtrees
    uint inner_nodes;
    uint leaves;
    uint empty_leaves;
    uint depth;
    uint subtree_nodes;             // what subtrees need below their roots
    uint subtree_references;
    uint root_leaf_references;      // of those that are leaves for want of room
    uint subtree_inner;
    uint subtree_leaves;
    uint subtree_empty;
    uint most_references;           // of a level
    uint most_cut;                  // of all leaves, if nothing was split any more
    uint most_nodes;                // of all levels
    uint most_subtrees;
    uint ended;
    uint is_short;                  // parts on the right found no room
    uint first_record;              // records before those that are built over, of a tree that objects are merged into
};

layout(push_constant, scalar) uniform KdBuildArguments {
    uvec2 vertices;
    uvec2 indices;
    uvec2 transform;
    uvec2 structure_address;
    uvec2 state_address;
    uint vertex_stride;
    uint vertex_count;
    uint formats;
    uint primitive_count;
    float c_t;
    float c_i;
    float bin_part;                 // two over the number of bins
    uint depth_limit;
    uint leaf_size;
    uint level;
    uint reference_capacity;        // of a level
    uint task_capacity;
    uint chunk_capacity;
    uint subtree_capacity;
    uint node_room;
    uint level_node_room;           // of those, what levels may have
    uint reference_room;
    uint cut_room;                  // of those, as many as all leaves have if nothing was split any more: there is always room for them
    uint build_flags;
    uint record_room;
    uint first_tile;                // of an object that is merged, as the next
    uint first_primitive;
};

KdState build_state() {
    return KdState(state_address);
}

Geometry given_geometry() {
    return Geometry(vertices, indices, transform, vertex_stride, vertex_count, formats, 0);
}

KdReferences references_of(uint of_level) {
    return KdReferences(build_state().references[of_level & 1u]);
}

KdTasks tasks_of(uint of_level) {
    return KdTasks(build_state().tasks[of_level & 1u]);
}

KdSubtrees all_subtrees() {
    return KdSubtrees(build_state().subtrees);
}

KdSides chunk_sides() {
    return KdSides(build_state().chunks);
}

KdSides chunk_tiles() {
    return KdSides(build_state().chunk_tiles);
}

KdSums task_tiles() {
    return KdSums(build_state().task_tiles);
}

KdSides subtree_tiles() {
    return KdSides(build_state().subtree_tiles);
}

uint tiles_of(uint count) {
    return (count + TILE - 1u) / TILE;
}

// Nodes that subtrees may have below their roots.
uint subtree_node_room() {
    return node_room - level_node_room;
}

// References that subtrees may have.
uint subtree_room() {
    return reference_room - cut_room;
}

// Phases as the pool counts them: of all levels BIN, CLASSIFY and DISTRIBUTE.
const uint PHASE_COUNT = 0;
const uint PHASE_PLAN = 1;
const uint PHASE_RECORDS = 2;
const uint PHASE_ROOT = 3;
const uint PHASE_LEVELS = 4;
const uint PHASE_ORDER = PHASE_LEVELS + 3 * LEVELS;
const uint PHASE_PLACE = PHASE_ORDER + 1;
const uint PHASES = PHASE_PLACE + 1;

uint bin_phase(uint of_level) {
    return PHASE_LEVELS + 3u * of_level;
}

bool ends_by_rule(uint count, uint depth) {
    return count < leaf_size || depth >= depth_limit;
}

uint chunks_of(uint count) {
    return (count + CHUNK - 1u) / CHUNK;
}

// The task of a level that a chunk is of: the last that begins with it or before.
uint task_of_chunk(uint of_level, uint chunk) {
    KdTasks tasks = tasks_of(of_level);
    uint at = 0, end = build_state().task_count[of_level];
    for (uint halving = 0; halving < 32 && at + 1 < end; ++halving) {
        uint middle = at + (end - at) / 2;
        if (tasks.task[middle].first_chunk <= chunk) at = middle;
        else end = middle;
    }
    return at;
}

// ---- workgroups ----

// Of each subgroup, up to four things at a time: each barrier is a place where a workgroup waits and where drivers compile more. A
// subgroup may be smaller than the device says. Never a short array: Mesa would unroll the loops over it.
shared uvec4 partial[gl_WorkGroupSize.x < 64u ? 64u : gl_WorkGroupSize.x];
shared uvec2 agreed;

// What each subgroup has of something, for all to read.
void exchange(uvec4 own) {
    barrier();
    if (subgroupElect()) partial[gl_SubgroupID] = own;
    barrier();
}

// Sums within subgroups become those of the workgroup.
void add_subgroups(inout uvec4 before, inout uvec4 total) {
    if (gl_NumSubgroups == 1u) return;
    exchange(total);
    total = uvec4(0);
    for (uint s = 0; s < gl_NumSubgroups; ++s) {
        if (s < gl_SubgroupID) before += partial[s];
        total += partial[s];
    }
}

// The sum of what lanes before have, and of all.
uint sum_before(uint value, out uint total) {
    uvec4 before = uvec4(subgroupExclusiveAdd(value), uvec3(0)), all = uvec4(subgroupAdd(value), uvec3(0));
    add_subgroups(before, all);
    total = all.x;
    return before.x;
}

uvec2 sum_before(uvec2 value, out uvec2 total) {
    uvec4 before = uvec4(subgroupExclusiveAdd(value), uvec2(0)), all = uvec4(subgroupAdd(value), uvec2(0));
    add_subgroups(before, all);
    total = all.xy;
    return before.xy;
}

uvec4 sum_before(uvec4 value, out uvec4 total) {
    uvec4 before = subgroupExclusiveAdd(value);
    total = subgroupAdd(value);
    add_subgroups(before, total);
    return before;
}

// Of each of three numbers the least.
uvec3 least_of_all(uvec3 value) {
    uvec3 least = subgroupMin(value);
    if (gl_NumSubgroups > 1u) {
        exchange(uvec4(least, 0u));
        for (uint s = 0; s < gl_NumSubgroups; ++s) least = min(least, partial[s].xyz);
    }
    return least;
}

uint least_of_all(uint value) {
    return least_of_all(uvec3(value)).x;
}

// The values of the first invocation, for all.
uvec2 agree(uvec2 value) {
    barrier();
    if (gl_LocalInvocationIndex == 0u) agreed = value;
    barrier();
    return agreed;
}

uint agree(uint value) {
    return agree(uvec2(value, 0u)).x;
}

// Makes what the workgroup has written available, before its first invocation counts it as arrived.
void release_workgroup() {
    release_to_device();
    barrier();
    release_to_device();
}

// Whether this is the last of these workgroups to arrive, by what the first invocation found at the counter: then what the others
// have written is visible.
bool is_last_of(uint arrived_before, uint count) {
    acquire_from_device();
    uint before = agree(arrived_before);
    acquire_from_device();
    return before + 1u == count;
}
#endif
