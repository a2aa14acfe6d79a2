// The steps of a query at quantised nodes: a part of trace/query_walk.glsl, which declares the query. As trace/walk_quantised.glsl, with the
// state of a query, but what waits is taken and its first node visited in one round, and the first leaf of a node is tested in the round of the
// node. With rounds of their own for them rays were no faster than in nodes of two (docs/notes/rays.md).
#ifndef HEDGEROW_TRACE_QUERY_QUANTISED
#define HEDGEROW_TRACE_QUERY_QUANTISED
#extension GL_EXT_control_flow_attributes : require

// The children of a quantised node that the ray enters are at hand: leaves first, then nodes from near to far.
void hedgerow_visit_quantised(inout HedgerowRayQuery query, QuantisedNode node) {
#ifdef HEDGEROW_COUNTS_WORK
    if (hedgerow_is_in_top(query)) query.work.x += 1u;
    else query.work.z += 1u;
#endif
    query.left = HEDGEROW_NOTHING;
    if (node.exponents_and_nodes == LONG_LEAF) {
        query.index = node.first_record;
        if (node.first_child != 0u) query.left = node.first_child;
    } else {
        float enters[8];
        enter_quantised(query.prepared, node, query.committed.t, enters);
        uint entered = 0u;
        [[unroll]] for (uint slot = 0; slot < 8; ++slot) {
            if (enters[slot] < HEDGEROW_INFINITY) entered |= 1u << slot;
        }
        entered &= query.begin_slots;
        query.begin_slots = ALL_SLOTS;
        // In a top level leaves are among the nodes, from near to far, as an instance takes longer than a node. An entry of the stack has no
        // room for where both begin: it names the node, which is asked again.
        uint nodes = hedgerow_is_in_top(query) ? 0xFFu : node.exponents_and_nodes >> 24;
        uint visits = in_octant(entered & nodes, query.octant);
        query.first_child = hedgerow_is_in_top(query) ? query.index : node.first_child;
        uvec2 next = next_of_group(entered & nodes, query.octant, enters, hedgerow_ends_at_first_hit(query));
        query.next = next.x;
        query.group = next.y | nodes << 8 | visits;
        query.first_record = node.first_record;
        query.counts = node.counts;
        query.leaves = in_octant(entered & ~nodes, query.octant);
    }
}

// In the first word of an entry of the stack: what waits are records of a top level.
const uint HEDGEROW_RECORDS_WAIT = 1u << 31;

// The rest of the leaf at hand waits.
void hedgerow_put_off_rest(inout HedgerowRayQuery query) {
    hedgerow_put_entry(hedgerow_place(query), uvec2(query.index | HEDGEROW_RECORDS_WAIT, query.left));
    query.level++;
}

// An entry of the stack, such a rest or what is left of a group, is at hand, if it is one: what is too far is nothing.
void hedgerow_take_entry(inout HedgerowRayQuery query, uvec2 waiting, bool waits) {
    bool is_rest = waits && hedgerow_is_in_top(query) && (waiting.x & HEDGEROW_RECORDS_WAIT) != 0u;
    query.index = is_rest ? waiting.x & ~HEDGEROW_RECORDS_WAIT : query.index;
    query.left = is_rest ? waiting.y : HEDGEROW_NOTHING;
    query.first_child = waiting.x;
    // Equally far is not too far: an equally near hit that comes before may be there.
    bool is_near = uintBitsToFloat(waiting.y & 0xFFFF0000u) <= query.committed.t;
    query.group = waits && !is_rest && is_near ? waiting.y : 0u;
    query.next = uint(findLSB(waiting.y & 0xFFu));
}

bool hedgerow_has_group(HedgerowRayQuery query) {
    return (query.group & 0xFFu | query.leaves) != 0u;
}

// The next of the leaves at hand, if nothing else is.
void hedgerow_take_leaf(inout HedgerowRayQuery query) {
    if (query.left == HEDGEROW_NOTHING && query.leaves != 0u) {
        uint slot = uint(findLSB(query.leaves)) ^ query.octant;
        query.leaves &= query.leaves - 1u;
        uint count = byte_of_slot(query.counts, slot);
        query.index = query.first_record + sum_below(query.counts, slot);
        // A slot without a child may be among them.
        query.left = count != 0u ? count : HEDGEROW_NOTHING;
    }
}

// The next node of those at hand, if nothing else is.
void hedgerow_take_of_group(inout HedgerowRayQuery query) {
    uint visits = query.group & 0xFFu;
    if (query.left == HEDGEROW_NOTHING && query.leaves == 0u && visits != 0u) {
        uint slot = query.next ^ query.octant;
        uint left = visits & ~(1u << query.next);
        if (hedgerow_is_in_top(query)) {
            HedgerowNames names = hedgerow_names_at(query.structure, query.first_child);
            uint count = byte_of_slot(names.counts, slot);
            bool is_node = (names.nodes >> slot & 1u) != 0u;
            query.index = is_node ? names.first_child + rank_of_node(names.nodes, slot) : names.first_record + sum_below(names.counts, slot);
            query.left = is_node ? 0u : count != 0u ? count : HEDGEROW_NOTHING;
        } else {
            query.index = query.first_child + rank_of_node(query.group >> 8 & 0xFFu, slot);
            query.left = 0u;
        }
        if (left != 0u && query.level - hedgerow_bottom(query) < MAX_DEPTH) {
            hedgerow_put_entry(hedgerow_place(query), uvec2(query.first_child, query.group ^ visits ^ left));
            query.level++;
        }
        query.group = 0u;
    }
}
#endif
