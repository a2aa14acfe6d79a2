// The drafts of a build across levels become the nodes of a structure: level by level, as the other schedules write them, and with the
// same bytes. A *tile* of the drafts of a level is summed up by a workgroup, the last tile to arrive scans the tiles; when the sums are
// known each draft goes to its place, its references and its subtree with it, and names its children for the next level.
#ifndef HEDGEROW_KDTREE_ACROSS_PLACE
#define HEDGEROW_KDTREE_ACROSS_PLACE
#include "kdtree/across/memory.glsl"
#include "kdtree/across/pool.glsl"
#include "kdtree/place.glsl"

// Phases of the pool that does this: SUM and WRITE of each level.
const uint PLACE_PHASES = 2 * LEVELS;
// Sums of a tile, or of all tiles before: children and references of leaves, nodes and references of subtrees.
const uint TILE_BYTES = 16;
// References of a leaf from which on the workgroup copies it together.
const uint LARGE_LEAF = 32;

BUFFER KdDraftTiles { uvec4 sums[]; };

KdDraftTiles draft_tiles() {
    return KdDraftTiles(across_state().tiles);
}

// The drafts of all levels, in their order.
Words order_of_drafts() {
    return Words(build_state().sides);
}

uint children_of(KdDraft d) {
    if ((d.kind & 3u) != DRAFT_INNER) return 0u;
    return 2u - ((d.kind & DRAFT_LEFT_EMPTY) != 0u ? 1u : 0u) - ((d.kind & DRAFT_RIGHT_EMPTY) != 0u ? 1u : 0u);
}

// What a draft adds to the sums.
uvec4 sums_of(KdDraft d) {
    uint of = d.kind & 3u;
    uvec4 sums = uvec4(children_of(d), 0u, 0u, 0u);
    if (of == DRAFT_LEAF) sums.y = d.count;
    if (of == DRAFT_SUBTREE) sums.zw = uvec2(d.count & 0xFFu, d.count >> 8);
    return sums;
}

// Replaces the sums of tiles by those of the tiles before; returns the sum of all.
uvec4 scan_draft_tiles(uint tiles) {
    KdDraftTiles all = draft_tiles();
    uvec4 sum = uvec4(0);
    for (uint base = 0; base < tiles; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uvec4 own = i < tiles ? all.sums[i] : uvec4(0), total, before = sum_before(own, total);
        if (i < tiles) all.sums[i] = sum + before;
        sum += total;
    }
    return sum;
}

// What the build needed, as far as it is known: of what there was too little, that much, and of the other things as much as was there.
void report_across() {
    KdState state = build_state();
    KdAcross across = across_state();
    bool is_short = across.is_short != 0u;
    uint nodes = across.node_count, references = across.reference_count, in_arena = min(across.arena_used, reference_capacity);
    if (is_short) {
        nodes = (across.is_short & SHORT_OF_NODES) != 0u ? node_room : max(nodes, node_room / 2u);
        references = (across.is_short & SHORT_OF_REFERENCES) != 0u ? reference_room : max(references, reference_room / 2u);
        in_arena = (across.is_short & SHORT_OF_ARENA) != 0u ? reference_capacity : max(in_arena, reference_capacity / 2u);
    }
    uint subtree_nodes = min(state.subtree_nodes, nodes), subtree_references = min(state.subtree_references, references);
    state.report = KdReport(state.status, 0u, nodes - subtree_nodes, subtree_nodes, references - subtree_references,
                            subtree_references, across.subtree_count, is_short ? 1u : 0u, in_arena, across.retrievals,
                            across.skipped);
}

// The header, and the first of all drafts. A pool whose spin ran out leaves no tree: an empty one, and the status says why.
void begin_places() {
    KdState state = build_state();
    KdAcross across = across_state();
    if (ChunkPool(across.pool).status != 0u) {
        state.status |= STATUS_SPIN_RAN_OUT;
        state.active_count = 0u;
        across.node_count = 0u;
        across.reference_count = 0u;
    }
    write_header(uvec2(across.node_count, across.reference_count));
    report_across();
}

// Where the drafts of a level begin, and how many there are. `before` counts those of the level itself.
uvec2 drafts_of_level(uint of_level) {
    KdAcross across = across_state();
    uint first = of_level == 0u ? 0u : across.before[of_level - 1u].x;
    return uvec2(first, across.before[of_level].x - first);
}

// Tasks that write this many drafts.
uint writes_of(uint drafts) {
    return (drafts + ITEMS - 1u) / ITEMS;
}

void kd_sum_drafts(uint tile, uint of_level) {
    KdAcross across = across_state();
    Words order = order_of_drafts();
    if (of_level == 0u) {
        if (gl_LocalInvocationIndex == 0u) {
            begin_places();
            // The root's draft lies behind its references.
            order.word[0] = build_state().active_count;
            across.before[0] = uvec4(min(across.node_count, 1u), 0u, 0u, 0u);
        }
        next_phase();
    }
    uvec2 level = drafts_of_level(of_level);
    uint first = level.x, count = level.y, end = min(tile * TILE + TILE, count);
    uvec4 sum = uvec4(0);
    for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uint at = order.word[first + min(i, end - 1u)];
        uvec4 own = i < end ? sums_of(drafts().draft[at]) : uvec4(0), total, before = sum + sum_before(own, total);
        if (i < end) {
            bool is_subtree = own.z + own.w > 0u;
            drafts().draft[at].nodes_before = is_subtree ? before.z : before.x;
            drafts().draft[at].references_before = is_subtree ? before.w : before.y;
        }
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u) draft_tiles().sums[tile] = sum;
    release_workgroup();
    uint arrived = 0, tiles = max(tiles_of(count), 1u);
    if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(across.scanned[of_level], 1u);
    if (!is_last_of(arrived, tiles)) return;
    uvec4 all = scan_draft_tiles(tiles);
    if (gl_LocalInvocationIndex != 0u) return;
    across.before[of_level + 1u] = across.before[of_level] + all;
    PoolState places = PoolState(state_address);
    places.tasks[2u * of_level + 1u] = writes_of(count);
    if (of_level + 1u < LEVELS) places.tasks[2u * of_level + 2u] = tiles_of(all.x);
}

// A draft's node, references and subtree to their places, and its children behind all drafts of its level.
void write_draft(uint i, uint of_level) {
    KdState state = build_state();
    KdAcross across = across_state();
    KdStructure structure = KdStructure(structure_address);
    Words order = order_of_drafts(), references = Words(kd_references_at(structure_address, node_room));
    uint first = drafts_of_level(of_level).x;
    uvec4 before = across.before[of_level];
    KdDraft d = drafts().draft[order.word[first + i]];
    uvec4 of_tile = draft_tiles().sums[i / TILE];
    uint of = d.kind & 3u;
    if (of == DRAFT_INNER) {
        if (gl_LocalInvocationIndex != 0u) return;
        uint child = before.x + of_tile.x + d.nodes_before, children = children_of(d);
        for (uint k = 0; k < children; ++k) order.word[child + k] = d.first + k;
        structure.nodes[first + i] = kd_inner(d.kind >> 2 & 3u, uintBitsToFloat(d.count), child, (d.kind & DRAFT_LEFT_EMPTY) != 0u,
                                              (d.kind & DRAFT_RIGHT_EMPTY) != 0u);
        return;
    }
    if (of == DRAFT_LEAF) {
        uint to = before.y + of_tile.y + d.references_before;
        if (gl_LocalInvocationIndex == 0u) structure.nodes[first + i] = kd_leaf(to, d.count);
        KdReferences from = arena();
        for (uint k = gl_LocalInvocationIndex; k < d.count; k += gl_WorkGroupSize.x) {
            references.word[to + k] = from.reference[d.first + k].record;
        }
        return;
    }
    // Behind all nodes of levels, and behind all references of their leaves.
    uvec2 to = uvec2(across.node_count - state.subtree_nodes, across.reference_count - state.subtree_references);
    to += before.zw + of_tile.zw + uvec2(d.nodes_before, d.references_before);
    uint nodes = d.count & 0xFFu, count = d.count >> 8;
    KdNodes from_nodes = KdNodes(arena_at(d.first));
    Words from = Words(address_of(arena_at(d.first), nodes, 8u));
    if (gl_LocalInvocationIndex == 0u) structure.nodes[first + i] = moved(d.root, to.x, to.y);
    for (uint k = gl_LocalInvocationIndex; k < nodes; k += gl_WorkGroupSize.x) {
        structure.nodes[to.x + k] = moved(from_nodes.node[k], to.x, to.y);
    }
    for (uint k = gl_LocalInvocationIndex; k < count; k += gl_WorkGroupSize.x) references.word[to.y + k] = from.word[k];
}

// So many drafts, one after the other.
void kd_write_drafts(uint item, uint of_level) {
    uint end = min(item * ITEMS + ITEMS, drafts_of_level(of_level).y);
    for (uint i = item * ITEMS; i < end; ++i) write_draft(i, of_level);
}
#endif
