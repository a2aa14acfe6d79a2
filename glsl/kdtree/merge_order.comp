#version 460
// Where subtrees go, and the header of the merged tree; one workgroup. See kdtree/merge.glsl.
#include "kdtree/merge.glsl"
#include "kdtree/place.glsl"

void main() {
    KdState state = build_state();
    KdMerge merge = merge_state();
    KdStructure structure = KdStructure(structure_address);
    uvec2 used = order_subtrees();
    if (gl_LocalInvocationIndex != 0u) return;
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
