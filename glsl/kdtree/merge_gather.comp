#version 460
// The references of the marked leaves, those of the static tree first; a workgroup a leaf. See kdtree/merge.glsl.
#include "kdtree/merge.glsl"

void main() {
    KdState state = build_state();
    Words from = Words(kd_references_at(structure_address, node_room));
    KdReferences to = references_of(0u);
    uint marked = merge_state().marked_count;
    for (uint m = gl_WorkGroupID.x; m < marked; m += gl_NumWorkGroups.x) {
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
}
