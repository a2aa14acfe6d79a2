#version 460
// All steps for a small tree, by one workgroup: see bvh/wide/collapse.glsl for the contract.
//
// A chain of dispatches costs a small tree more than its work.
#define HEDGEROW_ONE_WORKGROUP
#include "bvh/wide/costs.glsl"
#include "bvh/wide/nodes.glsl"
#include "bvh/wide/open.glsl"
#include "bvh/wide/pair.glsl"
#include "bvh/wide/records.glsl"
#include "gpu/scan_range.glsl"

void clear_sums() {
    for (uint i = gl_LocalInvocationIndex; i <= source_slots; i += gl_WorkGroupSize.x) {
        first_children.word[i] = 0;
        if (QUANTISED) first_records.word[i] = 0;
    }
}

void main() {
    find_links(slots_in_use());
    next_phase();
    climb(slots_in_use());
    next_phase();
    // Links and costs are not read any more: what follows may lie in their memory.
    clear_sums();
    reset();
    next_phase();
    open_levels(0, LEVELS_AT_MOST);
    find_pairs();
    next_phase();
    scan_range(first_children, first_children, 0, source_slots + 1, 0, 1);
    if (QUANTISED) scan_range(first_records, first_records, 0, source_slots + 1, 0, 1);
    next_phase();
    write_nodes();
    next_phase();
    write_records();
}
