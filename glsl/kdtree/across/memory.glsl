// The memory of a build across levels: one arena that the caller gave, of which workers take what they need while they build.
//
// Papay 2025, section 9.8: a task has two pieces of memory. The first has its references; those of its children go to the second, and
// both are split for the children then. A piece that is too small is left, and another one taken by one atomic addition. The thesis
// cannot give back; here a worker keeps what leaves and subtrees need no more, in a table of its own, and takes from there first.
//
// The arena counts in references, 28 bytes. Nodes that have no place yet (*drafts*) and subtrees stay in it to the end.
#ifndef HEDGEROW_KDTREE_ACROSS_MEMORY
#define HEDGEROW_KDTREE_ACROSS_MEMORY
#include "kdtree/builder.glsl"
#extension GL_EXT_control_flow_attributes : require

// Behind a KdState.
BUFFER KdAcross {
    uvec2 pool;             // a ChunkPool
    uvec2 tasks;            // of its slots
    uvec2 own;              // of the workers themselves
    uvec2 tiles;            // two pairs of a tile of drafts
    uint arena_used;        // references that were taken at its beginning; what is taken in vain counts
    uint node_count;        // of the tree, as far as it is built
    uint reference_count;   // of its leaves, if nothing was split any more
    uint subtree_count;
    uint is_short;          // SHORT_*
    uint retrievals;
    uint skipped;
    uint scanned[LEVELS];   // tiles of drafts
    uvec4 before[LEVELS + 1u];   // drafts, with those of the level; references of leaves, subtrees' nodes and references before it
};

const uint ACROSS_BYTES = 1024;
const uint SHORT_OF_ARENA = 1;
const uint SHORT_OF_NODES = 2;
const uint SHORT_OF_REFERENCES = 4;

KdAcross across_state() {
    return KdAcross(address_of(state_address, 1u, STATE_BYTES));
}

KdReferences arena() {
    return KdReferences(build_state().references[0]);
}

uvec2 arena_at(uint piece) {
    return address_of(build_state().references[0], piece, 28u);
}

uint pieces_of_words(uint words) {
    return (words + 6u) / 7u;
}

void fall_short(uint of) {
    atomicOr(across_state().is_short, of);
    atomicOr(build_state().status, STATUS_OUT_OF_ROOM);
}

// What the worker has to give; empty ones have no size.
const uint PIECES = 16;
shared uint piece_begin[PIECES];
shared uint piece_size[PIECES];
// Where it puts what stays, and how much of that is left.
uint kept_begin = 0;
uint kept_size = 0;
const uint KEPT_AT_A_TIME = 64;

void clear_pieces() {
    for (uint i = gl_LocalInvocationIndex; i < PIECES; i += gl_WorkGroupSize.x) piece_size[i] = 0u;
    barrier();
}

// Pieces in the order of their sizes, and their numbers below.
uint piece_key(uint i) {
    return min(piece_size[i], (1u << 27) - 1u) << 5 | i;
}

// Gives a piece to the worker, together with what it has on either side. Of more than it can keep the smallest is lost.
void give_piece(uint begin, uint size) {
    if (size == 0u) return;
    uint own_before = NONE, own_behind = NONE, own_smallest = NONE;
    for (uint i = gl_LocalInvocationIndex; i < PIECES; i += gl_WorkGroupSize.x) {
        if (piece_size[i] > 0u && piece_begin[i] + piece_size[i] == begin) own_before = i;
        if (piece_size[i] > 0u && piece_begin[i] == begin + size) own_behind = i;
        own_smallest = min(own_smallest, piece_key(i));
    }
    uvec3 least = least_of_all(uvec3(own_before, own_behind, own_smallest));
    uint before = least.x, behind = least.y, to = least.z & PIECES - 1u;
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        if (before != NONE) {
            begin = piece_begin[before];
            size += piece_size[before];
            piece_size[before] = 0u;
            to = before;
        }
        if (behind != NONE) {
            size += piece_size[behind];
            piece_size[behind] = 0u;
            to = behind;
        }
        if (piece_size[to] < size) {
            piece_begin[to] = begin;
            piece_size[to] = size;
        }
    }
    barrier();
}

// A piece of what the worker has, or of the rest of the arena: NONE where there is none so large.
uint take_piece(uint size) {
    uint key = NONE;
    for (uint i = gl_LocalInvocationIndex; i < PIECES; i += gl_WorkGroupSize.x) {
        if (piece_size[i] >= size) key = min(key, piece_key(i));
    }
    key = least_of_all(key);
    uint begin = NONE;
    if (key != NONE) {
        uint i = key & PIECES - 1u;
        begin = piece_begin[i];
        barrier();
        if (gl_LocalInvocationIndex == 0u) {
            piece_begin[i] = begin + size;
            piece_size[i] -= size;
        }
        barrier();
        return begin;
    }
    if (gl_LocalInvocationIndex == 0u) {
        KdAcross across = across_state();
        // Asked before, so that the sum never wraps: all that is asked for at a time is for cells that are apart.
        uint used = atomicLoad(across.arena_used, gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelaxed);
        if (used <= reference_capacity && size <= reference_capacity - used) begin = atomicAdd(across.arena_used, size);
        if (begin != NONE && (begin > reference_capacity || size > reference_capacity - begin)) begin = NONE;
    }
    return agree(begin);
}

// A piece of at least `size`, and `more` where there is that; NONE where there is not even the least.
uint take_piece_or_less(inout uint size, uint more) {
    uint begin = NONE, taken = size;
    // One copy of what takes it, with its barriers.
    [[dont_unroll]] for (uint attempt = 0; attempt < 2u && begin == NONE; ++attempt) {
        taken = attempt == 0u ? size + more : size;
        begin = take_piece(taken);
    }
    size = taken;
    if (begin == NONE && gl_LocalInvocationIndex == 0u) fall_short(SHORT_OF_ARENA);
    return begin;
}

// A place for what stays to the end.
uint take_to_keep(uint size) {
    if (size > kept_size) {
        give_piece(kept_begin, kept_size);
        kept_size = size;
        kept_begin = take_piece_or_less(kept_size, max(size, KEPT_AT_A_TIME) - size);
        if (kept_begin == NONE) {
            kept_size = 0u;
            return NONE;
        }
    }
    uint begin = kept_begin;
    kept_begin += size;
    kept_size -= size;
    return begin;
}

// Whether the structure has room for so many more nodes and references. Sums only grow as a tree is built to its end: whenever there
// is no room, there is none for all of it, in whatever order it was built.
bool take_room(uint nodes, uint references) {
    uint fits = 0;
    if (gl_LocalInvocationIndex == 0u) {
        KdAcross across = across_state();
        uint node_end = atomicAdd(across.node_count, nodes) + nodes;
        uint reference_end = atomicAdd(across.reference_count, references) + references;
        uint short_of = (node_end > node_room ? SHORT_OF_NODES : 0u) | (reference_end > reference_room ? SHORT_OF_REFERENCES : 0u);
        if (short_of == 0u) {
            fits = 1u;
        } else {
            atomicAdd(across.node_count, 0u - nodes);
            atomicAdd(across.reference_count, 0u - references);
            fall_short(short_of);
        }
    }
    return agree(fits) == 1u;
}

void give_room(uint nodes, uint references) {
    if (gl_LocalInvocationIndex != 0u) return;
    atomicAdd(across_state().node_count, 0u - nodes);
    atomicAdd(across_state().reference_count, 0u - references);
}

// ---- drafts ----

const uint DRAFT_INNER = 1;
const uint DRAFT_LEAF = 2;
const uint DRAFT_SUBTREE = 3;
const uint DRAFT_LEFT_EMPTY = 16;    // the axis is in the two bits before
const uint DRAFT_RIGHT_EMPTY = 32;

// A node that has no place in the structure yet: as large as a reference.
struct KdDraft {
    uint kind;
    uint first;          // its children, those that are not empty; its references; its nodes below the root and then its references
    uint count;          // the plane's bits; references; nodes | references << 8
    KdNode root;         // of a subtree
    uint nodes_before;   // children, or nodes of subtrees, of its tile
    uint references_before;
};

BUFFER KdDrafts { KdDraft draft[]; };

KdDrafts drafts() {
    return KdDrafts(build_state().references[0]);
}
#endif
