#version 460
// Pairs of leaves of objects' trees in leaves of the static one: the triangles there, by the rule of merge_find.comp; workgroups share
// the leaves. See kdtree/merge.glsl.
#include "kdtree/merge.glsl"

void meet(KdItem item, float reach, uint first_record) {
    KdStructure tree = KdStructure(item.tree);
    KdNode leaf = tree.nodes[item.node];
    Words references = Words(kd_references_at(item.tree, tree.header.node_room));
    uint i = 0;
    do {
        uint j = item.first_record + references.word[(leaf.second >> 2) + i];
        Box part;
        if (clip_triangle(corners_of_record(first_record + j), reach, item.place.cell, part)) add_pair(item.place, j);
    } while (++i < leaf.first);
}

void main() {
    KdState state = build_state();
    KdMerge merge = merge_state();
    KdItems items = met_items();
    uint count = take_items(merge.met_count), stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) meet(items.item[i], state.reach, state.first_record);
}
