#version 460
// Sums tallies up from the leaves, into counts: see trace/counts.glsl for the contract.
#include "trace/counts.glsl"

// What rays did in all of a node's children.
struct Total {
    uint hits;
    uint work;
};

BUFFER Totals { Total total[]; };

layout(push_constant, scalar) uniform GatherCountsArguments {
    Structure structure;
    Words tallies;
    LinkCounts counts;
    Words parents;
    Words waits;
    Totals totals;
    uint slots;        // at most
    uint rounds;       // slots of an invocation
    uint c_t;
    uint c_i;
    uint halvings;     // of what was counted before; 32 drop it
};

// How many slots there are to look at, as in bvh/child_order.glsl.
uint slots_in_use() {
    Header header = structure.header;
    bool usable = header.magic == MAGIC && header.active_count != 0u && (header.status & STATUS_UNUSABLE) == 0u;
    return usable && header.root.count == 0u && header.node_slots <= slots ? header.node_slots : 0u;
}

uint kept(uint before) {
    return halvings < 32u ? before >> halvings : 0u;
}

// Adds what was tallied of a link to what was counted of it before.
void count_link(uint link, LinkCount more) {
    LinkCount before = counts.count[link];
    counts.count[link] = LinkCount(saturated_sum(kept(before.entered), more.entered), saturated_sum(kept(before.hits), more.hits),
                                   saturated_sum(kept(before.work), more.work));
}

// Of a link whose child is counted.
LinkCount tallied(uint link, Child child, uint node_slots) {
    uint tally = tally_of(link >> 1), side = link & 1u;
    uint entered = tallies.word[tally + side];
    if (child.count != 0u) {
        return LinkCount(entered, tallies.word[tally + TALLY_HITS + side], saturated_product(entered, saturated_product(c_i, child.count)));
    }
    Total below = totals.total[min(child.index, node_slots - 1u)];
    return LinkCount(entered, below.hits, saturated_sum(saturated_product(c_t, entered), below.work));
}

// Of a node whose children are counted. What is tallied next begins from nothing.
void gather_node(uint slot, uint node_slots) {
    Node node = structure.nodes[slot];
    LinkCount left = tallied(2u * slot, node.left, node_slots), right = tallied(2u * slot + 1u, node.right, node_slots);
    count_link(2u * slot, left);
    count_link(2u * slot + 1u, right);
    uint tally = tally_of(slot);
    totals.total[slot] = Total(left.hits + right.hits - tallies.word[tally + TALLY_TWICE], saturated_sum(left.work, right.work));
    for (uint i = 0; i < TALLY_WORDS; ++i) tallies.word[tally + i] = 0u;
}

// Of a slot without links.
void gather_nothing(uint slot) {
    count_link(2u * slot, LinkCount(0u, 0u, 0u));
    count_link(2u * slot + 1u, LinkCount(0u, 0u, 0u));
}

void gather(uint slot, uint node_slots) {
    uint waiting = waits.word[slot];
    if (waiting == UNUSED) gather_nothing(slot);
    if (waiting != 0u) return;
    // As many levels as a tree has at most.
    for (uint level = 0; level <= MAX_DEPTH; ++level) {
        gather_node(slot, node_slots);
        slot = parents.word[slot];
        if (slot >= node_slots) return;
        release_to_device();
        // Another inner child is not done yet, and goes on.
        if (atomicAdd(waits.word[slot], 0xFFFFFFFFu) != 2u) return;
        acquire_from_device();
    }
}

void main() {
    uint first = group_number() * gl_WorkGroupSize.x * rounds + gl_LocalInvocationIndex;
    uint node_slots = slots_in_use();
    for (uint round = 0; round < rounds; ++round) {
        uint slot = first + round * gl_WorkGroupSize.x;
        if (slot < node_slots) gather(slot, node_slots);
        // A structure that cannot be traced has no links, but what was counted before is dropped all the same.
        else if (node_slots == 0u && slot < slots) gather_nothing(slot);
    }
}
