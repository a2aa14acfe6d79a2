// Subtrees in their order behind the levels, and the header.
#ifndef HEDGEROW_KDTREE_PLACE
#define HEDGEROW_KDTREE_PLACE
#include "kdtree/scan.glsl"

// Where the nodes and the references of the subtrees of a tile go, counted in the tile. The last tile to arrive scans the tiles: true
// for it, with how many nodes and references the structure has.
bool order_subtrees(uint tile, out uvec2 used) {
    KdState state = build_state();
    KdSubtrees subtrees = all_subtrees();
    KdSides tiles = subtree_tiles();
    uint count = state.subtree_count, end = min(tile * TILE + TILE, count), arrived = 0;
    uvec2 sum = uvec2(0);
    for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uvec2 own = uvec2(0), total;
        if (i < end) own = uvec2(subtrees.subtree[i].nodes, subtrees.subtree[i].references);
        uvec2 before = sum + sum_before(own, total);
        if (i < end) {
            subtrees.subtree[i].first_node = before.x;
            subtrees.subtree[i].first_reference = before.y;
        }
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u) tiles.side[tile] = sum;
    release_workgroup();
    if (gl_LocalInvocationIndex == 0u) arrived = atomicAdd(state.ordered, 1u);
    used = uvec2(state.node_count, state.leaf_count);
    if (!is_last_of(arrived, max(tiles_of(count), 1u))) return false;
    used += scan_pairs(tiles, 0u, tiles_of(count));
    if (gl_LocalInvocationIndex == 0u) PoolState(state_address).tasks[PHASE_PLACE] = (count + ITEMS - 1u) / ITEMS;
    return true;
}

// The header of a structure that has so many nodes and references; by one invocation.
void write_header(uvec2 used) {
    KdState state = build_state();
    KdHeader header;
    header.magic = MAGIC;
    header.kind = KIND_KD_TREE;
    header.status = state.status;
    header.primitive_count = primitive_count;
    header.lo = state.cell_lo;
    header.hi = state.cell_hi;
    header.node_count = used.x;
    header.reference_count = used.y;
    header.active_count = state.active_count;
    header.inner_nodes = state.inner_nodes + state.subtree_inner;
    header.leaves = state.leaves + state.subtree_leaves;
    header.empty_leaves = state.empty_leaves + state.subtree_empty;
    header.geometry_count = count_geometries(given_geometry());
    GeometryTable table = kd_geometries_at(structure_address, node_room, reference_room, record_room);
    header.geometry_flags = write_geometries(given_geometry(), header.geometry_count, table);
    header.build_flags = build_flags;
    header.depth = state.depth;
    header.area_scale = state.area_scale;
    header.reach = state.reach;
    header.node_room = node_room;
    header.reference_room = reference_room;
    header.record_room = record_room;
    header.replaced_nodes = 0u;
    header.replaced_references = 0u;
    for (uint k = 0; k < 5; ++k) header.reserved[k] = 0u;
    KdStructure(structure_address).header = header;
}

void kd_order_subtrees(uint tile) {
    KdState state = build_state();
    uvec2 used;
    if (!order_subtrees(tile, used) || gl_LocalInvocationIndex != 0u) return;
    write_header(used);
    // What the pool has drawn, if there is one; a chain has as many.
    PoolState pool = PoolState(state_address);
    uint tickets = 0;
    for (uint phase = 0; phase < PHASES; ++phase) tickets += pool.tasks[phase];
    state.report = KdReport(state.status, state.most_references, state.most_nodes, state.subtree_nodes, state.most_cut,
                            state.subtree_references, state.most_subtrees, state.ended, 0u, tickets, 0u);
}

// Where a node of a subtree goes, what it names goes too: a subtree's nodes count from 1, its references from 0.
KdNode moved(KdNode node, uint first_node, uint first_reference) {
    if (kd_is_leaf(node)) node.second += first_reference << 2;
    else node.second += first_node - 1u << 4;
    return node;
}

void kd_place_subtree(uint s) {
    KdState state = build_state();
    KdStructure structure = KdStructure(structure_address);
    KdSubtree t = all_subtrees().subtree[s];
    KdNodes nodes = KdNodes(state.nodes);
    Words from = Words(state.leaf_references), to = Words(kd_references_at(structure_address, node_room));
    uvec2 first = uvec2(state.node_count, state.leaf_count) + subtree_tiles().side[s / TILE];
    t.first_node += first.x;
    t.first_reference += first.y;
    if (gl_LocalInvocationIndex == 0u) structure.nodes[t.node] = moved(t.root, t.first_node, t.first_reference);
    for (uint i = gl_LocalInvocationIndex; i < t.nodes; i += gl_WorkGroupSize.x) {
        structure.nodes[t.first_node + i] = moved(nodes.node[t.nodes_at + i], t.first_node, t.first_reference);
    }
    for (uint i = gl_LocalInvocationIndex; i < t.references; i += gl_WorkGroupSize.x) {
        to.word[t.first_reference + i] = from.word[t.references_at + i];
    }
}

// So many subtrees, one after the other.
void kd_place(uint tile) {
    uint count = build_state().subtree_count;
    for (uint s = tile * ITEMS; s < min(tile * ITEMS + ITEMS, count); ++s) kd_place_subtree(s);
}
#endif
