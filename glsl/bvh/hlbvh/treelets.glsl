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

// Whether a subtree has no parent, or one that is not a treelet: one that splits at a bit that treelets share, or has too many
// primitives. Its positions begin (or end) where the subtree's do, and share all bits of the code above the one that it splits at.
bool is_treelet(Run run, bool is_left, Subtree s) {
    if (s.first == 0u && s.last + 1u == run.active_count) return true;
    uint split = is_left ? s.behind : s.before;
    if (split >= POSITION_WORD_BITS + kind_of_codes().bits - treelet_bits()) return true;
    uint most = min(TREELET_PRIMITIVES, run.active_count);
    uint from = is_left ? s.first : max(s.last, most) - most;
    uint to = from + most;
    if (to >= run.active_count || (!is_left && to != s.last)) return false;
    return bit_between(run.codes, from, to) <= split;
}

void climb(inout Run run, Weights w, float area_scale, Subtree s) {
    // As many levels as there are primitives, at most.
    for (uint level = 0; level < run.active_count; ++level) {
        bool is_left = is_left_child(s);
        if (is_treelet(run, is_left, s)) {
            // Until the node of this slot is there, its counts hold what the treelet is to hlbvh_gather().
            w.counts.node[s.last] = NodeCounts(reference_of(s.child), floatBitsToUint(s.cost));
            break;
        }
        uint parent = parent_of(s, is_left);
        w.parents.word[parent_at(reference_of(s.child))] = 2u * parent + (is_left ? 0u : 1u);
        Sibling sibling;
        if (!step_up(run, is_left, parent, s, sibling)) break;
        // No treelet ends there, which siblings that met within the run have not said yet.
        run.ends.word[parent] = s.first;
        s.child.index = parent;
        s.child.count = 0u;
        float area = scaled_half_area(Box(s.child.lo, s.child.hi), area_scale);
        vec2 costs = is_left ? vec2(s.cost, sibling.cost) : vec2(sibling.cost, s.cost);
        s.cost = weigh_node(w, parent, uvec2(parent + 1u - s.first, s.last - parent), costs, area);
    }
}

void hlbvh_treelets(uint task) {
    Weights w = weights();
    Geometry input_geometries = geometries();
    float area_scale = build_state().plan.area_scale;
    Run run = run_of(task);
    uint position = run.first;
    uint end = min(position + ITEMS, run.active_count);
    for (uint turn = 0; turn < TURNS; ++turn) {
        begin_turn(run, turn);
        uint split = gl_LocalInvocationIndex;
        // First the leaves of the run; then what waits, last first; in the second turn what is left over.
        for (uint taken = 0; taken < 2u * ITEMS; ++taken) {
            Subtree s;
            if (position < end) {
                Cluster c = cluster_of_primitive(input_geometries, position, area_scale);
                begin_leaf(run, s);
                s.child = child_of(c);
                s.cost = c.cost;
                position++;
            } else if (run.waiting > 0u) {
                s = take_waiting(run);
            } else if (!MEETS_IN_GROUP || turn == 0u || !take_left_over(run, split, s)) {
                break;
            }
            climb(run, w, area_scale, s);
        }
        end_turn();
    }
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
