// The treelets of an HLBVH: see bvh/hlbvh.glsl for the contract.
//
// A treelet is a subtree of the radix tree that has at most TREELET_PRIMITIVES, which share TREELET_BITS of the code, and whose
// parent is none. The climb ends where a treelet is complete. Nothing asks the split behind a treelet's last position for the
// parent: its weights hold the treelet's root and cost until the clusters are gathered, and its word in `ends` stays as it was.
#ifndef HEDGEROW_BVH_HLBVH_TREELETS
#define HEDGEROW_BVH_HLBVH_TREELETS
#include "bvh/hlbvh.glsl"
// Children stay as the codes have them.
const uint RULE = 0;
#include "bvh/run.glsl"

// Whether a subtree is not all there is and splits off its sibling at a bit that treelets do not share.
bool parent_shares_bits(Run run, Subtree s) {
    return min(s.before, s.behind) < POSITION_WORD_BITS + kind_of_codes().bits - treelet_bits();
}

// Whether the parent has too many primitives. Its positions begin (or end) where the subtree's do, and share all bits of the code above
// the one that it splits at.
bool parent_is_too_large(Run run, Subtree s) {
    bool is_left = is_left_child(s);
    uint most = min(TREELET_PRIMITIVES, run.active_count);
    uint from = is_left ? s.first : max(s.last, most) - most;
    uint to = from + most;
    if (to >= run.active_count || (!is_left && to != s.last)) return false;
    return bit_between(run.codes, from, to) <= (is_left ? s.behind : s.before);
}

// Until the node of this slot is there, its counts hold what the treelet that ends there is to hlbvh_gather().
void write_treelet(uint last, Weighed own) {
    weights().counts.node[last] = NodeCounts(reference_of(own.child), floatBitsToUint(own.cost));
}

// Writes what is known of a subtree where it belongs; returns whether it is a treelet.
bool place(Run run, Subtree s, Weighed own) {
    bool is_treelet = !parent_shares_bits(run, s);
    if (is_treelet) {
        write_treelet(s.last, own);
    } else {
        bool is_left = is_left_child(s);
        uint parent = parent_of(s, is_left);
        weights().parents.word[parent_at(reference_of(own.child))] = 2u * parent + (is_left ? 0u : 1u);
        write_child(run, parent, is_left, own);
    }
    return is_treelet;
}

// Makes the node of a subtree of its two children at `slot`, and places it; if it has too many primitives, both are treelets.
bool join(inout Run run, uint slot, Subtree s) {
    Weighed left = child_at(run, slot, true), right = child_at(run, slot, false);
    bool is_too_large = s.last - s.first >= TREELET_PRIMITIVES;
    bool has_ended = true;
    if (is_too_large) {
        write_treelet(slot, left);
        write_treelet(s.last, right);
    } else {
        // No treelet ends there.
        run.ends.word[slot] = s.first;
        Weighed own;
        own.child = Child(min(left.child.lo, right.child.lo), slot, max(left.child.hi, right.child.hi), 0u);
        float area = scaled_half_area(Box(own.child.lo, own.child.hi), run.area_scale);
        own.cost = weigh_node(weights(), slot, uvec2(slot + 1u - s.first, s.last - slot), vec2(left.cost, right.cost), area);
        own.weight = NO_WEIGHT;
        has_ended = place(run, s, own);
    }
    return has_ended;
}

// Of subtrees whose siblings are in the run, `join` finds out.
bool ends_at(Run run, Subtree s) {
    bool is_treelet = parent_is_too_large(run, s);
    if (is_treelet) {
        bool is_left = is_left_child(s);
        write_treelet(s.last, child_at(run, parent_of(s, is_left), is_left));
    }
    return is_treelet;
}

void write_leaves(Run run) {
    Geometry input_geometries = geometries();
    uvec2 code = code_of_first(run);
    uint before = run.before;
    for (uint position = run.begin; position < run.end; ++position) {
        Cluster c = cluster_of_primitive(input_geometries, position, run.area_scale);
        Weighed own = Weighed(child_of(c), c.cost, NO_WEIGHT);
        place_leaf(run, position, own, before, code);
    }
}

void hlbvh_treelets(uint task) {
    Run run = run_of(task);
    write_leaves(run);
    join_in_run(run);
    join_beyond_run(run);
}

// ---- count, scan, gather ----

// Whether a treelet ends at a position.
bool ends_treelet(uint position, uint active_count) {
    return position + 1u == active_count || Words(part(parts.ends)).word[position] == NONE;
}

uint treelets_of_strip(uint task) {
    uint active_count = build_state().active_count;
    uint begin = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    uint count = 0;
    for (uint i = begin; i < min(begin + ITEMS, active_count); ++i) count += ends_treelet(i, active_count) ? 1u : 0u;
    return count;
}

void hlbvh_count(uint task) {
    write_tile_sum(task, treelets_of_strip(task));
}

void hlbvh_scan() {
    uint count = scan_tiles(tiles_of(primitive_count));
    if (gl_LocalInvocationIndex == 0u) {
        PoolState pool = PoolState(scratch_address);
        build_state().cluster_counts[0] = count;
        pool.tasks[pool_phase(PHASE_SPLIT)] = count > 1u ? 1u : 0u;
        pool.tasks[pool_phase(PHASE_WEIGH)] = tiles_of(count);
    }
}

// The cluster of the treelet that ends at a position.
Cluster cluster_of_treelet(Structure structure, Weights w, Geometry input_geometries, uint last, float area_scale) {
    uint reference = w.counts.node[last].all;
    if ((reference & IS_PRIMITIVE) != 0u) return cluster_of_primitive(input_geometries, last, area_scale);
    Child left = structure.nodes[reference].left, right = structure.nodes[reference].right;
    uint count = w.counts.node[reference].all & ~IS_LEAF;
    float cost = uintBitsToFloat(w.counts.node[last].left);
    return Cluster(min(left.lo, right.lo), reference, max(left.hi, right.hi), count, cost, last + 1u - count);
}

void hlbvh_gather(uint task) {
    BuildState state = build_state();
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Clusters clusters = all_clusters();
    Geometry input_geometries = geometries();
    uint active_count = state.active_count;
    uint total;
    uint place = sums_of_tiles().word[task] + sum_before(treelets_of_strip(task), total);
    uint begin = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    for (uint i = begin; i < min(begin + ITEMS, active_count); ++i) {
        if (ends_treelet(i, active_count)) {
            Cluster c = cluster_of_treelet(structure, w, input_geometries, i, state.plan.area_scale);
            clusters.cluster[place] = c;
            order_of(0).word[place] = place;
            place++;
            if (treelet_count() == 1u) write_root(structure, w, c);
        }
    }
}
#endif
