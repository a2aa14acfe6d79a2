// One ray on its way through a tree of quantised nodes, step by step: the twin of src/trace/twin/wide.rs, visit for visit.
//
// As Ylitie, Karras and Laine (2017, section 4) do: the children of a node that are nodes and that the ray enters are a group,
// met from near to far by counting slots in the order of the ray's octant; what is left of a group waits as one entry. The
// leaves that the ray enters come first. Unlike there, the node that it enters first is met first, unless any hit ends the ray, and an entry
// holds where the ray enters the nearest of the nodes that wait, in the leading half of a float; a group that is farther than the best hit by
// then is left out.
#ifndef HEDGEROW_TRACE_WALK_QUANTISED
#define HEDGEROW_TRACE_WALK_QUANTISED
#extension GL_EXT_control_flow_attributes : require
#include "bvh/wide/pairs.glsl"
#include "trace/buffers.glsl"
#include "trace/nearest.glsl"
#include "trace/quantised_boxes.glsl"
#include "trace/quantised_slots.glsl"
#include "trace/stack.glsl"

struct QuantisedWalk {
    HedgerowPreparedRay ray;
    // Bits of the axes in which the ray goes down.
    uint octant;
    // The group at hand: its first node, which slots are nodes, and which places, in the order of the octant, must be visited.
    uint first_child;
    uint nodes;
    uint visits;
    // The place of the next of them.
    uint next;
    // Where the ray enters the nearest of the group but the next: the leading half of a float, not above it.
    uint enter;
    // The leaves at hand, likewise.
    uint first_record;
    uvec2 counts;
    uint leaves;
    // The next record, and how many units are left of its leaf.
    uint record;
    uint left;
    // How many groups wait.
    uint level;
    float best;
    HedgerowHit hit;
    // Nodes visited, triangles tested, leaves visited.
    uvec3 work;
};

// At the root; a ray that cannot hit anything has nothing at hand and nothing that waits.
void begin(HedgerowRay ray, Child root, bool usable, out QuantisedWalk walk) {
    bool goes = hedgerow_prepare(ray, walk.ray) && usable;
    uvec3 down = floatBitsToUint(walk.ray.inverse) >> 31;
    walk.octant = down.x | down.y << 1 | down.z << 2;
    // The root is the only node of a group.
    walk.first_child = 0;
    walk.nodes = 1;
    walk.visits = goes ? in_octant(1, walk.octant) : 0;
    walk.next = walk.octant;
    walk.enter = 0;
    walk.first_record = 0;
    walk.counts = uvec2(0);
    walk.leaves = 0;
    walk.record = 0;
    walk.left = 0;
    walk.level = 0;
    walk.best = walk.ray.t_max;
    walk.hit = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
    walk.work = uvec3(0);
}

bool at_node(QuantisedWalk walk) {
    return walk.left == 0u && walk.leaves == 0u && walk.visits != 0u;
}

bool at_triangle(QuantisedWalk walk) {
    return walk.left != 0u;
}

// The next node of the group; what is left of it waits.
uint next_node(inout QuantisedWalk walk) {
    uint slot = walk.next ^ walk.octant;
    walk.visits &= ~(1u << walk.next);
    if (walk.visits != 0u) {
        hedgerow_put_entry(walk.level, uvec2(walk.first_child, walk.enter | walk.nodes << 8 | walk.visits));
        walk.level++;
    }
    return walk.first_child + rank_of_node(walk.nodes, slot);
}

void visit(QuantisedNode node, bool any_hit, inout QuantisedWalk walk) {
    walk.work.x++;
    walk.visits = 0;
    if (node.exponents_and_nodes == LONG_LEAF) {
        walk.record = node.first_record;
        walk.left = node.first_child;
        walk.work.z++;
    } else {
        float enters[8];
        enter_quantised(walk.ray, node, walk.best, enters);
        uint entered = 0;
        [[unroll]] for (uint slot = 0; slot < 8; ++slot) {
            if (enters[slot] < HEDGEROW_INFINITY) entered |= 1u << slot;
        }
        walk.first_child = node.first_child;
        walk.nodes = node.exponents_and_nodes >> 24;
        uint nodes = entered & walk.nodes;
        walk.visits = in_octant(nodes, walk.octant);
        uvec2 next = next_of_group(nodes, walk.octant, enters, any_hit);
        walk.next = next.x;
        walk.enter = next.y;
        walk.first_record = node.first_record;
        walk.counts = node.counts;
        // A slot without a child may be among them: a leaf of nothing.
        walk.leaves = in_octant(entered & ~walk.nodes, walk.octant);
    }
}

// The next leaf, if the last one is done.
void next_leaf(inout QuantisedWalk walk) {
    if (walk.left == 0u && walk.leaves != 0u) {
        uint slot = uint(findLSB(walk.leaves)) ^ walk.octant;
        walk.leaves &= walk.leaves - 1u;
        walk.record = walk.first_record + sum_below(walk.counts, slot);
        walk.left = byte_of_slot(walk.counts, slot);
        if (walk.left != 0u) walk.work.z++;
    }
}

void meet(Triangle triangle, bool any_hit, inout QuantisedWalk walk) {
    walk.work.y++;
    if (hit_nearer(walk.ray, triangle, any_hit, walk.best, walk.hit) && any_hit) {
        walk.left = 0;
        walk.leaves = 0;
        walk.visits = 0;
        walk.level = 0;
    }
}

// The next record of the leaf: one triangle, or two. `second` is what lies behind the first of two.
void test_record(Triangle first, SecondOfPair second, bool any_hit, inout QuantisedWalk walk) {
    uint units = units_of_record(first);
    walk.record += units;
    walk.left -= min(walk.left, units);
    meet(first_of_pair(first), any_hit, walk);
    bool has_ended = any_hit && walk.hit.primitive != HEDGEROW_NONE;
    if (has_second(first) && !has_ended) meet(second_of_pair(first, second), any_hit, walk);
}

// Takes a group that waits, if there is nothing at hand; whether there was any. Equally far is not too far: an equally near hit
// with a lower index may be there.
bool go_on(inout QuantisedWalk walk) {
    bool is_at_hand = walk.left != 0u || walk.leaves != 0u || walk.visits != 0u;
    bool waits = !is_at_hand && walk.level != 0u;
    if (waits) {
        walk.level--;
        uvec2 entry = hedgerow_entry(walk.level);
        walk.first_child = entry.x;
        walk.next = uint(findLSB(entry.y & 0xFFu));
        walk.enter = entry.y & 0xFFFF0000u;
        walk.nodes = entry.y >> 8 & 0xFFu;
        walk.visits = uintBitsToFloat(walk.enter) <= walk.best ? entry.y & 0xFFu : 0;
    }
    return is_at_hand || waits;
}
#endif
