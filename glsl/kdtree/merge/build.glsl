// What of a merge is around the levels of its build: the references of marked leaves before, the header and the leaves' places
// behind. See kdtree/merge.glsl.
#ifndef HEDGEROW_KDTREE_MERGE_BUILD
#define HEDGEROW_KDTREE_MERGE_BUILD
#include "kdtree/merge.glsl"
#include "kdtree/place.glsl"

// The references of a marked leaf, those of the static tree first; by one workgroup.
void kd_gather(uint m) {
    KdState state = build_state();
    Words from = Words(kd_references_at(structure_address, node_room));
    KdReferences to = references_of(0u);
    KdMarked leaf = marked_leaves().leaf[m];
    KdTask task = tasks_of(0u).task[m];
    Box cell = Box(task.lo, task.hi);
    for (uint i = gl_LocalInvocationIndex; i < leaf.count; i += gl_WorkGroupSize.x) {
        uint record = 0;
        if (i < leaf.own) record = from.word[leaf.from + i];
        else record = state.first_record + record_of_key(leaf.first + i - leaf.own);
        Corners corners = corners_of_record(record);
        Box part;
        // What was referenced there and is beside the cell by rounding stays, at a face.
        if (!clip_triangle(corners, state.reach, cell, part)) {
            Box whole = bounds_of(corners, state.reach);
            part = Box(min(max(whole.lo, cell.lo), cell.hi), min(max(whole.hi, cell.lo), cell.hi));
        }
        to.reference[leaf.begin + i] = KdReference(part.lo, record, part.hi);
    }
}

// Where the subtrees of a tile go, and by the last tile the header of the merged tree.
void kd_order_merged(uint tile) {
    KdState state = build_state();
    KdMerge merge = merge_state();
    KdStructure structure = KdStructure(structure_address);
    uvec2 used;
    if (!order_subtrees(tile, used) || gl_LocalInvocationIndex != 0u) return;
    KdHeader header = structure.header;
    merge.status |= state.status;
    merge.level_references = state.most_references;
    merge.level_nodes = state.most_nodes - header.node_count;
    merge.subtree_nodes = state.subtree_nodes;
    merge.cut_references = state.most_cut - header.reference_count;
    merge.subtree_references = state.subtree_references;
    merge.subtrees = state.most_subtrees;
    merge.ended = state.ended;
    uint empty = merge.marked_empty + merge.marked_root;
    header.status |= merge.status;
    header.primitive_count = max(header.primitive_count, merge.primitive_end);
    header.lo = state.cell_lo;
    header.hi = state.cell_hi;
    header.node_count = used.x;
    header.reference_count = used.y;
    header.active_count += state.active_count;
    header.inner_nodes += state.inner_nodes + state.subtree_inner;
    header.leaves += state.leaves + state.subtree_leaves - (merge.marked_count - empty);
    header.empty_leaves += state.empty_leaves + state.subtree_empty - empty;
    header.depth = max(header.depth, state.depth);
    header.area_scale = state.area_scale;
    // Roots are hooked elsewhere, unless one is that of all; siblings of empty leaves have moved.
    header.replaced_nodes += merge.marked_count - merge.marked_root + merge.marked_empty;
    header.replaced_references += merge.replaced_references;
    structure.header = header;
}

// The root of what was built to the place of a marked leaf, and what was there to where it is kept; an invocation a leaf. No two write
// the same node, and none reads what another writes.
void kd_hook_leaf(uint m) {
    KdMerge merge = merge_state();
    KdStructure structure = KdStructure(structure_address);
    KdUndo kept = KdUndo(merge.undo);
    KdMarked leaf = marked_leaves().leaf[m];
    KdNode root = structure.nodes[merge.first_root + m];
    if (leaf.node == NONE && leaf.id == ROOT_ID) {
        kept.undone[m] = KdUndone(NONE, root);
        return;
    }
    uint parent = leaf.id - 1u >> 1, side = leaf.id - 1u & 1u;
    uint slot = leaf.node == NONE ? parent : leaf.node;
    KdNode before = structure.nodes[slot];
    kept.undone[m] = KdUndone(slot, before);
    if (leaf.node != NONE) {
        structure.nodes[leaf.home] = root;
        return;
    }
    structure.nodes[leaf.home] = KdNode(before.first, before.second & 3u | leaf.pair << 4);
    structure.nodes[leaf.pair + side] = root;
    if (leaf.copies == 1u) structure.nodes[leaf.pair + 1u - side] = structure.nodes[before.second >> 4];
}

// A tile of them.
void kd_hook(uint tile) {
    uint end = min(tile * TILE + TILE, merge_state().marked_count);
    for (uint m = tile * TILE + gl_LocalInvocationIndex; m < end; m += gl_WorkGroupSize.x) kd_hook_leaf(m);
}
#endif
