// Which binary nodes a wide node takes in, so that all wide nodes together cost least: src/bvh/twin/wide/costs.rs is the twin and has
// the rules, src/bvh/wide/device.rs records the step.
//
//   links  reads the source                   writes starts, costs: what names a node; choices: how many of a node's children are nodes
//   costs  reads the source, starts, costs    writes choices, costs
//
// A climb begins at each node over two leaves; of two inner children the second that is done goes on with their parent.
//
// needs  a barrier before, between both and behind; both with as many workgroups of the same size; any subgroup size
#ifndef HEDGEROW_BVH_WIDE_COSTS
#define HEDGEROW_BVH_WIDE_COSTS
#include "bvh/wide/choice.glsl"
#include "bvh/wide/collapse.glsl"

// Whether nodes cost what rays were counted in them, rather than their area.
layout(constant_id = 6) const bool BY_VISITS = false;

// src/bvh/wide/mod.rs
const float PRIOR_RAYS = 8.0;

const uint NO_LINK = 0xFFFFFFFFu;

// starts.word   of each invocation, one at each of its slots, nodes over two leaves, and NO_LINK behind the last
// costs.of      QUADS of each of source_slots: what names the node, which is its place among all children, twice the parent's slot and one
//               for the right one; then, when its subtree is done, what it costs in 1, 2 and more places
const uint QUADS = WIDTH / 4;

// How many slots there are to look at.
uint slots_in_use() {
    Header header = source.header;
    return can_be_collapsed(header) && header.root.count == 0u && header.node_slots <= source_slots ? header.node_slots : 0u;
}

bool is_inner(Child child, uint node_slots) {
    return child.count == 0u && child.index < node_slots;
}

// The word that names a node.
void write_link(uint slot, uint link) {
    Words(uvec2(costs)).word[4u * QUADS * slot] = link;
}

uint link_of(uint slot) {
    return Words(uvec2(costs)).word[4u * QUADS * slot];
}

// What a subtree costs, in up to 7 places; a leaf costs nothing.
struct Costs {
    float of[8];
};

Costs costs_of(Child child, uint node_slots) {
    bool inner = is_inner(child, node_slots);
    uvec4 few = uvec4(0u), more = uvec4(0u);
    if (inner) few = costs.of[QUADS * child.index];
    if (inner && WIDTH == 8u) more = costs.of[QUADS * child.index + 1u];
    vec3 in_few = uintBitsToFloat(few.yzw);
    vec4 in_more = uintBitsToFloat(more);
    return Costs(float[8](0.0, in_few.x, in_few.y, in_few.z, in_more.x, in_more.y, in_more.z, in_more.w));
}

void write_costs(uint slot, uint link, Costs known) {
    costs.of[QUADS * slot] = uvec4(link, floatBitsToUint(vec3(known.of[1], known.of[2], known.of[3])));
    if (WIDTH == 8u) {
        costs.of[QUADS * slot + 1u] = floatBitsToUint(vec4(known.of[4], known.of[5], known.of[6], known.of[7]));
    }
}

// A bit for each number of places from 2 on: whether the subtree costs less in them than in one less.
uint cheaper_places(Costs known) {
    uint cheaper = 0u;
    [[unroll]] for (uint i = 2; i < 8; ++i) cheaper |= (i < WIDTH && known.of[i] < known.of[i - 1u] ? 1u : 0u) << i - 2u;
    return cheaper;
}

// What a wide node costs that begins with the binary node of these children.
float own_cost(Child left, Child right, uint link, float scale) {
    float area = scaled_half_area(Box(min(left.lo, right.lo), max(left.hi, right.hi)), scale);
    if (!BY_VISITS || link == NO_LINK) return area;
    Child root = source.header.root;
    precise float entered = float(visits.count[link].entered) * scaled_half_area(Box(root.lo, root.hi), scale);
    precise float weight = entered + PRIOR_RAYS * area;
    return weight;
}

// Where that is less: the cost with k places for the left child.
void better(float cost, uint k, inout float best, inout uint least) {
    least = cost < best ? k : least;
    best = min(cost, best);
}

// What is known of the children of a node becomes what is of the node.
void choose(uint slot, uint link, uint node_slots, float scale) {
    Child left = source.nodes[slot].left, right = source.nodes[slot].right;
    Costs of_left = costs_of(left, node_slots), of_right = costs_of(right, node_slots);
    // Of equal ones the least for the left child. In more places than there are nothing is asked for. Written out, as shaderc does not unroll
    // a loop in a loop, and arrays that are indexed by loops lie in memory.
#define ONE_FOR_THE_LEFT(places)                                        \
    float best##places = of_left.of[1] + of_right.of[places - 1];       \
    uint least##places = 1u
#define OR_SO_MANY(places, k) better(of_left.of[k] + of_right.of[places - k], k, best##places, least##places)
    ONE_FOR_THE_LEFT(2);
    ONE_FOR_THE_LEFT(3); OR_SO_MANY(3, 2);
    ONE_FOR_THE_LEFT(4); OR_SO_MANY(4, 2); OR_SO_MANY(4, 3);
    ONE_FOR_THE_LEFT(5); OR_SO_MANY(5, 2); OR_SO_MANY(5, 3); OR_SO_MANY(5, 4);
    ONE_FOR_THE_LEFT(6); OR_SO_MANY(6, 2); OR_SO_MANY(6, 3); OR_SO_MANY(6, 4); OR_SO_MANY(6, 5);
    ONE_FOR_THE_LEFT(7); OR_SO_MANY(7, 2); OR_SO_MANY(7, 3); OR_SO_MANY(7, 4); OR_SO_MANY(7, 5); OR_SO_MANY(7, 6);
    ONE_FOR_THE_LEFT(8); OR_SO_MANY(8, 2); OR_SO_MANY(8, 3); OR_SO_MANY(8, 4); OR_SO_MANY(8, 5); OR_SO_MANY(8, 6); OR_SO_MANY(8, 7);
#undef ONE_FOR_THE_LEFT
#undef OR_SO_MANY
    float opened[8] = float[8](0.0, 0.0, best2, best3, best4, best5, best6, best7);
    uint choice = least2 | least3 << 3 | least4 << 6 | least5 << 9 | least6 << 12 | least7 << 15 | least8 << 18;
    float before = WIDTH == 4u ? best4 : best8;
    uint left_gets = WIDTH == 4u ? least4 : least8;
    before += own_cost(left, right, link, scale);
    Costs known = Costs(float[8](0.0, before, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0));
    [[unroll]] for (uint i = 2; i < 8; ++i) known.of[i] = min(opened[i], known.of[i - 1u]);
    write_costs(slot, link, known);
    uint both = places_within(cheaper_places(of_left), left_gets) + places_within(cheaper_places(of_right), WIDTH - left_gets);
    choices.word[slot] = choice | cheaper_places(known) << CHOICE_CHEAPER | both - 2u << CHOICE_CHILDREN;
}

// What is known of all slots of an invocation before climbs begin.
void find_links(uint node_slots) {
    uint found = 0u;
    for (uint k = 0, slot = grid_item(0); slot < node_slots; slot = grid_item(++k)) {
        Child left = source.nodes[slot].left, right = source.nodes[slot].right;
        if (slot == source.header.root.index) write_link(slot, NO_LINK);
        if (left.count == UNUSED) continue;
        bool of_left = is_inner(left, node_slots), of_right = is_inner(right, node_slots);
        if (of_left) write_link(left.index, 2u * slot);
        if (of_right) write_link(right.index, 2u * slot + 1u);
        choices.word[slot] = uint(of_left) + uint(of_right);
        if (!of_left && !of_right) starts.word[grid_item(found++)] = slot;
    }
    uint end = grid_item(found);
    if (end < node_slots) starts.word[end] = NO_LINK;
}

// The `k`th node of this invocation's over two leaves, or NO_LINK.
uint start_of(uint k, uint node_slots) {
    uint at = grid_item(k);
    return at < node_slots ? starts.word[at] : NO_LINK;
}

// All climbs that are this invocation's. As soon as one has ended the next one begins: lanes do not wait for each other at the root.
void climb(uint node_slots) {
    float scale = source.header.area_scale;
    uint k = 0u;
    uint slot = start_of(k++, node_slots);
    while (slot < node_slots) {
        uint link = link_of(slot);
        choose(slot, link, node_slots, scale);
        release_to_device();
        slot = link >> 1;
        // Another inner child that is not done yet goes on.
        bool goes_on = slot < node_slots && atomicAdd(choices.word[slot], 0xFFFFFFFFu) == 1u;
        acquire_from_device();
        if (!goes_on) slot = start_of(k++, node_slots);
    }
}
#endif
