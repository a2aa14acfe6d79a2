// Exclusive scan of a range of words by one workgroup, from memory to memory, which may be the same. Sums wrap around at 2^32.
//
// needs  all invocations of the workgroup; any subgroup size
#ifndef HEDGEROW_GPU_SCAN_RANGE
#define HEDGEROW_GPU_SCAN_RANGE
#include "gpu/pass.glsl"

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

// Exclusive scan of words[first..end], starting from `sum`; returns the sum behind the last. An invocation takes `each` words that lie side by
// side at once.
uint scan_range(Words from, Words to, uint first, uint end, uint sum, uint each) {
    for (uint base = first; base < end; base += gl_WorkGroupSize.x * each) {
        uint own = min(base + gl_LocalInvocationIndex * each, end);
        uint own_end = min(own + each, end);
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
