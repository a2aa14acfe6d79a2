// Counts of rays by the links of a Bvh2: src/trace/counts.rs records the steps and says what is counted, src/trace/twin/counts.rs is the
// twin: the same numbers.
//
//   rays    reads structure, every `stride`-th of rays    adds to tallies
//   (parents of bvh/child_order)                          writes parents, waits
//   gather  reads structure, tallies, parents             writes counts; scratch: totals, waits; zeroes tallies
//
// A ray adds 1 for each link that it goes into, and no more for what follows from that: the work of a subtree is that of all links below,
// summed from the leaves up. Rays that hit something in it are not the sum of those that do in its children, for a ray may hit
// in both. A ray adds 1 for each leaf in which it hits something, and at the node where its ways to two such leaves that come one after
// the other part, it adds 1 to what was counted twice: of k leaves of a subtree, k − 1 such nodes are in it.
//
// needs  tallies zeroed at first; one barrier before, between each two, and after; subgroups of any size
#ifndef HEDGEROW_TRACE_COUNTS
#define HEDGEROW_TRACE_COUNTS
#include "bvh/counts.glsl"
#include "bvh/layout.glsl"

// Words of the tally of a node: rays that went into its left and its right child, those that hit something in either if that is a leaf,
// and how many were counted twice where its children meet.
const uint TALLY_WORDS = 5;
const uint TALLY_HITS = 2;
const uint TALLY_TWICE = 4;

uint tally_of(uint slot) {
    return TALLY_WORDS * slot;
}

uint saturated_sum(uint a, uint b) {
    uint carry;
    uint sum = uaddCarry(a, b, carry);
    return carry != 0u ? 0xFFFFFFFFu : sum;
}

uint saturated_product(uint a, uint b) {
    uint high, low;
    umulExtended(a, b, high, low);
    return high != 0u ? 0xFFFFFFFFu : low;
}
#endif
