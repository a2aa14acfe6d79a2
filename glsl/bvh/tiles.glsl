// Sums over tiles, a workgroup's worth of items, of which each invocation has a strip: what a compaction needs to know where the
// items that stay go to. Sum each tile (`write_tile_sum`), scan the sums by one workgroup (`scan_tiles`), then each tile scans
// its strips again (`sum_before`).
//
// needs one barrier between each two; subgroups of any size; workgroups of whole subgroups or less than one
#ifndef HEDGEROW_BVH_TILES
#define HEDGEROW_BVH_TILES
#include "bvh/build_state.glsl"
#extension GL_EXT_control_flow_attributes : require

// A workgroup may have as many subgroups as invocations.
shared uint partial[gl_WorkGroupSize.x];

Words sums_of_tiles() {
    return Words(part(parts.sums));
}

uint tile_size() {
    return gl_WorkGroupSize.x * ITEMS;
}

uint tiles_of(uint count) {
    return (count + tile_size() - 1u) / tile_size();
}

void write_tile_sum(uint task, uint value) {
    uint own = subgroupAdd(value);
    if (gl_SubgroupInvocationID == 0u) partial[gl_SubgroupID] = own;
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        uint sum = 0;
        for (uint s = 0; s < gl_NumSubgroups; ++s) sum += partial[s];
        sums_of_tiles().word[task] = sum;
    }
    barrier();
}

// The sum of what lanes before have, and of all.
uint sum_before(uint value, out uint total) {
    uint before = subgroupExclusiveAdd(value), own_total = subgroupAdd(value);
    barrier();
    if (gl_SubgroupInvocationID == 0u) partial[gl_SubgroupID] = own_total;
    barrier();
    total = 0;
    for (uint s = 0; s < gl_NumSubgroups; ++s) {
        if (s < gl_SubgroupID) before += partial[s];
        total += partial[s];
    }
    return before;
}

// Sums of a lane that a GPU loads at once.
const uint SUMS_AT_ONCE = 8;

// The same as scan_tiles, of neighbours by neighbours: lanes that each had a strip would load from as many places.
uint scan_side_by_side(Words sums, uint tiles) {
    uint before = 0;
    for (uint first = 0; first < tiles; first += SUMS_AT_ONCE * gl_WorkGroupSize.x) {
        uint begin = first + SUMS_AT_ONCE * gl_LocalInvocationIndex, own = 0, total;
        uint values[SUMS_AT_ONCE];
        [[unroll]] for (uint k = 0; k < SUMS_AT_ONCE; ++k) {
            values[k] = begin + k < tiles ? sums.word[begin + k] : 0;
            own += values[k];
        }
        uint sum = before + sum_before(own, total);
        [[unroll]] for (uint k = 0; k < SUMS_AT_ONCE; ++k) {
            if (begin + k < tiles) sums.word[begin + k] = sum;
            sum += values[k];
        }
        before += total;
    }
    return before;
}

// Makes of each tile's sum that of the tiles before; returns the sum of all.
uint scan_tiles(uint tiles) {
    Words sums = sums_of_tiles();
    if (!PRIVATE_COUNTERS) return scan_side_by_side(sums, tiles);
    uint strip = (tiles + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
    uint begin = gl_LocalInvocationIndex * strip, end = min(begin + strip, tiles);
    uint own = 0;
    for (uint i = begin; i < end; ++i) own += sums.word[i];
    uint total;
    uint sum = sum_before(own, total);
    for (uint i = begin; i < end; ++i) {
        uint value = sums.word[i];
        sums.word[i] = sum;
        sum += value;
    }
    return total;
}
#endif
