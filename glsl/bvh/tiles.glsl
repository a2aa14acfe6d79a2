// Sums over tiles, a workgroup's worth of items, of which each invocation has a strip: what a compaction needs to know where the
// items that stay go to. Sum each tile (`write_tile_sum`), scan the sums by one workgroup (`scan_tiles`), then each tile scans
// its strips again (`sum_before`).
//
// needs one barrier between each two; subgroups of any size; workgroups of whole subgroups or less than one
#ifndef HEDGEROW_BVH_TILES
#define HEDGEROW_BVH_TILES
#include "bvh/encode.glsl"

shared uint partial[SUBGROUPS_AT_MOST];

Words sums_of_tiles() {
    return Words(table_address);
}

uint tile_size() {
    return gl_WorkGroupSize.x * ITEMS;
}

uint tiles_of(uint count) {
    return (count + tile_size() - 1u) / tile_size();
}

void write_tile_sum(uint task, uint value) {
    uint own = subgroupAdd(value);
    if (subgroupElect()) partial[gl_SubgroupID] = own;
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
    if (subgroupElect()) partial[gl_SubgroupID] = own_total;
    barrier();
    total = 0;
    for (uint s = 0; s < gl_NumSubgroups; ++s) {
        if (s < gl_SubgroupID) before += partial[s];
        total += partial[s];
    }
    return before;
}

// Makes of each tile's sum that of the tiles before; returns the sum of all.
uint scan_tiles(uint tiles) {
    Words sums = sums_of_tiles();
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
