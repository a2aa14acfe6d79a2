// A step of trace/walk.glsl at a quantised node, its children met by distance or by slots as in trace/walk_wide.glsl: the twin of
// src/trace/twin/wide.rs, visit for visit.
#ifndef HEDGEROW_TRACE_WALK_WIDE_QUANTISED
#define HEDGEROW_TRACE_WALK_WIDE_QUANTISED
#include "trace/quantised_boxes.glsl"
#include "trace/quantised_loads.glsl"
#include "trace/quantised_slots.glsl"
#include "trace/walk_wide.glsl"

void visit_wide(QuantisedNode node, inout Walk walk) {
    if (node.exponents_and_nodes == LONG_LEAF) {
        walk.work.x++;
        walk.index = node.first_record;
        walk.left = node.first_child;
        count_leaf(walk);
        return;
    }
    float enters[8];
    enter_quantised(walk.ray, node, walk.best, enters);
    uint nodes = node.exponents_and_nodes >> 24;
    uint next_node = node.first_child, next_record = node.first_record;
    [[unroll]] for (uint slot = 0; slot < 8; ++slot) {
        bool is_node = (nodes >> slot & 1u) != 0u;
        uint count = byte_of_slot(node.counts, slot);
        wide_enter[slot] = is_node || count != 0u ? enters[slot] : HEDGEROW_INFINITY;
        wide_index[slot] = is_node ? next_node : next_record;
        wide_count[slot] = count;
        next_node += is_node ? 1u : 0u;
        next_record += count;
    }
    go_to_first(walk);
}

// The next record of the leaf: one triangle, or two. `second` is what lies behind the first of two.
void test_record(Triangle first, SecondOfPair second, bool any_hit, inout Walk walk) {
    uint units = units_of_record(first);
    walk.index += units;
    walk.left = walk.left <= units ? NOTHING : walk.left - units;
    meet(first_of_pair(first), any_hit, walk);
    bool has_ended = any_hit && walk.hit.primitive != HEDGEROW_NONE;
    if (has_second(first) && !has_ended) meet(second_of_pair(first, second), any_hit, walk);
}

// Index and count of the child in a slot.
uvec2 quantised_child_in_slot(QuantisedNodes nodes, uint node, uint slot) {
    uint of_nodes = nodes.node[node].exponents_and_nodes >> 24;
    if ((of_nodes >> slot & 1u) != 0u) return uvec2(nodes.node[node].first_child + rank_of_node(of_nodes, slot), 0u);
    uvec2 counts = nodes.node[node].counts;
    return uvec2(nodes.node[node].first_record + sum_below(counts, slot), byte_of_slot(counts, slot));
}
#endif
