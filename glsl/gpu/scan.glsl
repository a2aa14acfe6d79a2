// Exclusive scan of words in three steps over tiles: sum each tile, scan the sums, scan each tile from its sum on.
// src/gpu/scan.rs records them and holds the twin. Sums wrap around at 2^32.
//
//   sum    reads values          writes sums[tile]
//   sums   reads sums            writes sums (exclusive), sums[tiles] = total; one workgroup
//   apply  reads values, sums    writes results (may be the values' memory)
//
// needs  one barrier between each two; any subgroup size
#ifndef HEDGEROW_GPU_SCAN
#define HEDGEROW_GPU_SCAN
#include "gpu/pass.glsl"

layout(push_constant, scalar) uniform ScanArguments {
    Words values;
    Words results;
    Words sums;
    uint count;
    uint rounds;   // words of an invocation in a tile
};

// Words that lie side by side which an invocation takes at once: one where a subgroup's loads shall lie side by side, several where a scan
// over lanes costs more than loads that do not.
layout(constant_id = 1) const uint EACH = 1;

// A workgroup may have as many subgroups as invocations.
shared uint scan_partial[gl_WorkGroupSize.x];

// Exclusive scan over the workgroup; `total` is the sum of all.
uint scan_workgroup(uint value, out uint total) {
    uint before = subgroupExclusiveAdd(value);
    uint subgroup_total = subgroupAdd(value);
    if (subgroupElect()) scan_partial[gl_SubgroupID] = subgroup_total;
    barrier();
    total = 0;
    for (uint s = 0; s < gl_NumSubgroups; ++s) {
        if (s < gl_SubgroupID) before += scan_partial[s];
        total += scan_partial[s];
    }
    barrier();
    return before;
}

// Exclusive scan of words[first..end], starting from `sum`; returns the sum behind the last.
uint scan_range(Words from, Words to, uint first, uint end, uint sum) {
    for (uint base = first; base < end; base += gl_WorkGroupSize.x * EACH) {
        uint own = min(base + gl_LocalInvocationIndex * EACH, end);
        uint own_end = min(own + EACH, end);
        uint own_sum = 0;
        for (uint i = own; i < own_end; ++i) own_sum += from.word[i];
        uint total;
        uint before = sum + scan_workgroup(own_sum, total);
        for (uint i = own; i < own_end; ++i) {
            uint word = from.word[i];
            to.word[i] = before;
            before += word;
        }
        sum += total;
    }
    return sum;
}
#endif
