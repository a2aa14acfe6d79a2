#version 460
// The static tree again: what a merge has overwritten, written back; workgroups share it. See kdtree/merge.glsl.
#include "kdtree/merge/setup.glsl"

void main() {
    KdUndo kept = KdUndo(undo);
    KdStructure structure = KdStructure(structure_address);
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    for (uint i = invocation_number(); i < kept.count; i += stride) {
        uint slot = kept.undone[i].slot;
        if (slot != 0xFFFFFFFFu) structure.nodes[slot] = kept.undone[i].node;
    }
    if (invocation_number() == 0u) structure.header = kept.header;
}
