// The steps `open` and `open_few` of bvh/wide/collapse.glsl: find the children of a wide node, and list those that are nodes.
#ifndef HEDGEROW_BVH_WIDE_OPEN
#define HEDGEROW_BVH_WIDE_OPEN
#include "bvh/wide/children.glsl"
#include "bvh/wide/octants.glsl"

// Each child in the slot of its number.
const uint IN_ORDER = 0x76543210u;

// Whether the rays that went into the first of two children ended there for less work than those in the second. A few rays that take a
// step and end nowhere stand beside those of each.
bool ends_more_rays(uint first_name, uint second_name) {
    LinkCount first = hits.count[first_name], second = hits.count[second_name];
    precise float of_first = float(first.hits) * (float(second.work) + PRIOR_WORK);
    precise float of_second = float(second.hits) * (float(first.work) + PRIOR_WORK);
    return of_first > of_second;
}

// The slots of so many children, four bits each, those first that end more rays for their work. Equal ones stay as they are.
uint slots_by_hits(uint count) {
    uint order = IN_ORDER;
    for (uint place = 1; place < count; ++place) {
        for (uint at = place; at > 0; --at) {
            uint here = order >> 4 * at & 15u, before = order >> 4 * (at - 1) & 15u;
            if (!ends_more_rays(name_of_child(here), name_of_child(before))) break;
            uint swap = here ^ before;
            order ^= swap << 4 * at | swap << 4 * (at - 1);
        }
    }
    uint slots = 0;
    for (uint place = 0; place < count; ++place) slots |= place << 4 * (order >> 4 * place & 15u);
    return slots;
}

// The slots of so many children, four bits each.
uint slots_of_children(uint count, uint slot) {
    bool has_order = source.header.child_order != 0;
    if (BY_HITS && has_order) return slots_by_hits(count);
    return QUANTISED && !has_order ? octant_slots(count, quarter_middle(box_of_node(slot))) : IN_ORDER;
}

// Lists the nodes of the lanes of a subgroup in one piece. All of them come here together, those that have none, too.
uint place_in_next_level(uint level, uint nodes) {
    uint before = subgroupExclusiveAdd(nodes);
    uint all = subgroupAdd(nodes);
    uint first = 0;
    if (subgroupElect()) first = atomicAdd(levels.count[level + 1], all);
    return subgroupBroadcastFirst(first) + before;
}

// Opens the node `i` of a level (the first of opened, and how many), if there is one. All invocations of a workgroup come here
// together.
void open(uint i, uvec2 of, uint level) {
    bool is_there = i < of.y;
    uint at = of.x + i, slot = 0, count = 0, slots_by_child = 0, node_mask = 0, inner = 0;
    if (is_there) {
        slot = opened.node[at].slot;
        count = open_children(slot, level);
        slots_by_child = slots_of_children(count, slot);
        uint records = 0, quads = WIDTH / 4u;
        for (uint q = 0; q < quads; ++q) slots.of[at * quads + q] = uvec4(NO_CHILD);
        [[unroll]] for (uint c = 0; c < 8; ++c) {
            if (c < count) {
                uint in_slot = slots_by_child >> 4 * c & 15u;
                bool is_leaf = open_count[c] != 0, is_long_leaf = is_long(open_count[c]);
                uint leaf = is_long_leaf ? LONG_LEAF_NODE : is_leaf ? SHORT_LEAF : 0;
                Words(uvec2(slots)).word[at * WIDTH + in_slot] = open_name[c] | leaf;
                node_mask |= (!is_leaf || is_long_leaf ? 1u : 0u) << in_slot;
                records += open_count[c];
                inner += is_leaf ? 0 : 1;
            }
        }
        choices.word[slot] = bitCount(node_mask);
        atomicOr(blocks.word[block_of(slot)], bit_in_block(slot));
        atomicAdd(blocks.word[nodes_of_block(block_of(slot))], bitCount(node_mask));
        if (QUANTISED && !is_paired()) note_units(slot, records);
    }

    uint next = of.x + of.y + place_in_next_level(level, inner);
    [[unroll]] for (uint c = 0; c < 8; ++c) {
        if (c < count && open_count[c] == 0 && next < capacity) {
            uint rank = bitCount(node_mask & (1u << (slots_by_child >> 4 * c & 15u)) - 1u);
            opened.node[next++] = Opened(open_index[c], slot << 3 | rank);
        }
    }
}

// One workgroup: the root as the only node of the first level.
void reset() {
    Header header = source.header;
    bool there_is = can_be_collapsed(header);
    for (uint l = gl_LocalInvocationIndex; l < LEVELS_AT_MOST; l += gl_WorkGroupSize.x) {
        levels.count[l] = l == 0 && there_is ? 1 : 0;
    }
    if (gl_LocalInvocationIndex == 0) {
        levels.first[0] = 0;
        levels.end = 0;
    }
    // A tree that is a leaf has no slot: the first one then stands for it.
    if (gl_LocalInvocationIndex == 0) opened.node[0] = Opened(is_inner(header.root) ? header.root.index : 0, 0);
}

// One workgroup: the nodes of several levels, as far as there are any.
void open_levels(uint first, uint end) {
    if (first == 0) {
        reset();
        next_phase();
    }
    for (uint l = first; l < end; ++l) {
        uvec2 of = opened_of(l);
        if (of.y == 0) break;
        for (uint i = gl_LocalInvocationIndex; i - gl_LocalInvocationIndex < of.y; i += gl_WorkGroupSize.x) open(i, of, l);
        if (gl_LocalInvocationIndex == 0) note_end(l, of.x + of.y);
        next_phase();
    }
}
#endif
