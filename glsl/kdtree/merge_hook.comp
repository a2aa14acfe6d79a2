#version 460
// The roots of what was built to the places of the marked leaves, and what was there to where it is kept; workgroups share the
// leaves. No two write the same node, and none reads what another writes. See kdtree/merge.glsl.
#include "kdtree/merge.glsl"

void main() {
    KdMerge merge = merge_state();
    KdStructure structure = KdStructure(structure_address);
    KdUndo kept = KdUndo(merge.undo);
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint m = gl_GlobalInvocationID.x; m < merge.marked_count; m += stride) {
        KdMarked leaf = marked_leaves().leaf[m];
        KdNode root = structure.nodes[merge.first_root + m];
        if (leaf.node == NONE && leaf.id == ROOT_ID) {
            kept.undone[m] = KdUndone(NONE, root);
            continue;
        }
        uint parent = leaf.id - 1u >> 1, side = leaf.id - 1u & 1u;
        uint slot = leaf.node == NONE ? parent : leaf.node;
        KdNode before = structure.nodes[slot];
        kept.undone[m] = KdUndone(slot, before);
        if (leaf.node != NONE) {
            structure.nodes[leaf.home] = root;
            continue;
        }
        structure.nodes[leaf.home] = KdNode(before.first, before.second & 3u | leaf.pair << 4);
        structure.nodes[leaf.pair + side] = root;
        if (leaf.copies == 1u) structure.nodes[leaf.pair + 1u - side] = structure.nodes[before.second >> 4];
    }
}
