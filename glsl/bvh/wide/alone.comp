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

void clear_blocks() {
    for (uint i = gl_LocalInvocationIndex; i < block_words(); i += gl_WorkGroupSize.x) blocks.word[i] = 0u;
}

void main() {
    find_links(slots_in_use());
    next_phase();
    climb(slots_in_use());
    next_phase();
    // Links and costs are not read any more: what follows may lie in their memory.
    clear_blocks();
    next_phase();
    open_levels(0, LEVELS_AT_MOST);
    find_pairs();
    next_phase();
    scan_range(blocks, blocks, block_count(), block_words(), 0, 1);
    next_phase();
    write_nodes();
    next_phase();
    write_records();
}
