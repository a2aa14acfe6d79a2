// H-PLOC (Benthin et al. 2024): PLOC within each node of the radix tree, bottom-up in one pass. src/bvh/hploc.rs records it;
// src/bvh/twin/hploc.rs is the twin.
//
//   begin      reads the primitives and values         writes scratch: clusters
//   hierarchy  reads clusters and keys                 writes nodes, root, costs, weights; scratch: clusters
//   (collapse: bvh/collapse.glsl)
//
// Each invocation climbs the radix tree from a run of positions; of two siblings the second to arrive goes on. What it meets
// there has up to half a window of clusters on either side, which lie side by side from the first position of their subtree on.
// Where they are more than half a window together, they are merged: by the invocation itself, or by teams of the workgroup's
// invocations. The window has the same width whatever the device's subgroups, and so the tree is the same.
//
// needs one barrier before, behind bvh/encode.glsl's phases; subgroups of any size
#ifndef HEDGEROW_BVH_HPLOC
#define HEDGEROW_BVH_HPLOC
#include "bvh/hploc/by_one.glsl"
#include "bvh/hploc/teams.glsl"
#include "bvh/radix_tree.glsl"

// Levels of a radix tree: a code bit or a position bit each.
const uint LEVELS = 64 + 27;

// Left children that wait for a sibling out of the same run of positions (bvh/run.glsl), as words of a `Waiting`. Until a leaf begins,
// its word has the bit of the split behind it.
shared uint run_words[ITEMS * gl_WorkGroupSize.x];

uint run_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

const uint POSITION_BITS = 27;
const uint CLUSTER_BITS = 5;

// Where a subtree in a run begins, how many clusters it has, and the bit of the split before it.
struct Waiting {
    uint first;
    uint clusters;
    uint before;
};

// Positions are counted from the run's first one.
uint packed_waiting(Waiting w, uint base) {
    return (w.first - base << CLUSTER_BITS | w.clusters - 1u) << SPLIT_BITS | w.before;
}

Waiting waiting_of(uint word, uint base) {
    uint before = word & (1u << SPLIT_BITS) - 1u;
    uint clusters = (word >> SPLIT_BITS & (1u << CLUSTER_BITS) - 1u) + 1u;
    return Waiting(base + (word >> SPLIT_BITS + CLUSTER_BITS), clusters, before);
}

// Between invocations: the end of a subtree that is away from its sibling, and how many clusters it has, in a word.
uint packed_end(uint end, uint clusters) {
    return end | (clusters - 1u) << POSITION_BITS;
}

uint position_of(uint packed) {
    return packed & (1u << POSITION_BITS) - 1u;
}

uint clusters_of(uint packed) {
    return (packed >> POSITION_BITS) + 1u;
}

// A subtree over the positions first..=last, and the bits of the splits before and behind it.
struct Range {
    uint first;
    uint last;
    uint clusters;
    uint before;
    uint behind;
};

bool is_whole(Range s, uint active_count) {
    return s.first == 0u && s.last + 1u == active_count;
}

// What is left of a run of positions.
struct Rest {
    uint base;           // its first position
    uint position;       // the next leaf
    uint end;
    uint behind;         // the split before the next leaf
    uint run;            // its first position; NONE once all leaves are done: siblings out of the run are met as any others then
    uint waiting;        // left children in the slots of the run
};

// The next leaves of a run that are a subtree by themselves: as many as need no merging, so that no step is taken for each.
Range take_leaves(inout Rest rest) {
    uint first = rest.position, inside = 0u;
    uint behind = run_words[run_slot(first - rest.base)];
    Range s = Range(first, first, 1u, rest.behind, behind);
    bool goes_on = true;
    for (uint k = 1; k < HALF_WINDOW && k < ITEMS; ++k) {
        inside = max(inside, behind);
        goes_on = goes_on && first + k < rest.end && inside < s.before;
        if (goes_on) behind = run_words[run_slot(first + k - rest.base)];
        if (goes_on && inside < behind) {
            s.last = first + k;
            s.behind = behind;
        }
    }
    s.clusters = s.last - first + 1u;
    rest.position = s.last + 1u;
    rest.behind = s.behind;
    return s;
}

// What an invocation climbs from next: leaves of its run, or then what waits there, last first. Outputs whether there is anything.
bool begin_next(inout Rest rest, out Range s) {
    s = Range(0u, 0u, 0u, 0u, 0u);
    if (rest.position < rest.end) {
        s = take_leaves(rest);
        return true;
    }
    if (rest.waiting == 0u) return false;
    // What was taken last began where this ends.
    Waiting behind = Waiting(rest.end, 1u, rest.behind);
    if (rest.run == NONE) behind = waiting_of(run_words[run_slot(rest.waiting)], rest.base);
    Waiting w = waiting_of(run_words[run_slot(--rest.waiting)], rest.base);
    s = Range(w.first, behind.first - 1u, w.clusters, w.before, behind.before);
    rest.run = NONE;
    return true;
}

// One step up from a subtree: whether its sibling is there. If so, `s` becomes their parent, and the clusters of both are output.
// No return in the middle, behind which each write would be masked, and one place that loads codes: siblings in a run know the splits.
bool step_up(Words codes, uint active_count, inout Rest rest, inout Range s, inout Request request) {
    Words ends = Words(part(parts.ends));
    bool is_left = s.behind < s.before;
    uint end = NONE, clusters = 0u, split = NO_SPLIT;
    if (is_left && s.first >= rest.run) {
        run_words[run_slot(rest.waiting++)] = packed_waiting(Waiting(s.first, s.clusters, s.before), rest.base);
    } else if (!is_left && rest.waiting > 0u) {
        Waiting w = waiting_of(run_words[run_slot(--rest.waiting)], rest.base);
        end = w.first;
        clusters = w.clusters;
        split = w.before;
    } else {
        release_to_device();
        uint met = atomicExchange(ends.word[is_left ? s.last : s.first - 1u], packed_end(is_left ? s.first : s.last, s.clusters));
        acquire_from_device();
        if (met != NONE) {
            end = position_of(met);
            clusters = clusters_of(met);
            bool has_neighbour = is_left ? end + 1u < active_count : end > 0u;
            uint before = is_left ? end : end - 1u;
            if (has_neighbour) split = bit_between(codes, before, before + 1u);
        }
    }
    bool is_there = end != NONE;
    if (is_there) {
        request.left = is_left ? s.first : end;
        request.left_count = is_left ? s.clusters : clusters;
        request.right = is_left ? s.last + 1u : s.first;
        request.right_count = is_left ? clusters : s.clusters;
        s.first = request.left;
        s.last = is_left ? end : s.last;
        s.clusters += clusters;
        request.is_whole = is_whole(s, active_count);
        s.before = is_left ? s.before : split;
        s.behind = is_left ? split : s.behind;
    }
    return is_there;
}

// Each primitive as a cluster of its own.
void hploc_begin(uint task) {
    Clusters clusters = all_clusters();
    Words list = cluster_list();
    Geometry input_geometries = geometries();
    float area_scale = build_state().plan.area_scale;
    uint active_count = build_state().active_count;
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint position = first + k * gl_WorkGroupSize.x;
        if (position < active_count) {
            clusters.cluster[position] = cluster_of_primitive(input_geometries, position, area_scale);
            list.word[position] = position;
        }
    }
}

// The splits behind all positions of a run. Outputs the split before it.
uint begin_run(Words codes, uint active_count, uint run, uint end) {
    if (run >= end) return NO_SPLIT;
    uint before = split_before(codes, run);
    uvec2 code = code_at(codes, run);
    for (uint position = run; position < end; ++position) {
        run_words[run_slot(position - run)] = split_to_next(codes, position, active_count, code);
    }
    return before;
}

void hploc_hierarchy(uint task) {
    BuildState state = build_state();
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Clusters clusters = all_clusters();
    Words codes = sorted_keys();
    uint active_count = state.active_count;
    float area_scale = state.plan.area_scale;
    uint run = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    uint end = min(run + ITEMS, active_count);
    uint before = begin_run(codes, active_count, run, end);
    if (!BY_ONE) reset_teams();
    Rest rest = Rest(run, run, end, before, run, 0u);
    bool climbs = false;
    Range s;
    // Each invocation goes as far as it can without a merge; then come the merges of all.
    for (uint turn = 0; turn < (ITEMS + 1u) * (LEVELS + 1u); ++turn) {
        Request request = NO_REQUEST;
        bool merges = false, done = false;
        for (uint steps = 0; steps < (ITEMS + 1u) * (LEVELS + 1u) && !merges && !done; ++steps) {
            // What begins takes its first step at once: lanes that climb wait for those that begin.
            if (!climbs) {
                climbs = begin_next(rest, s);
                done = !climbs;
                merges = climbs && is_whole(s, active_count);
                if (merges) request = Request(s.first, s.clusters, s.first, 0u, true);
            }
            if (climbs && !merges) {
                climbs = step_up(codes, active_count, rest, s, request);
                // Where they lie side by side and are few, nothing needs to be done.
                merges = climbs && (s.clusters > HALF_WINDOW || request.left + request.left_count != request.right || request.is_whole);
            }
        }
        uint left = 0u;
        bool any_works = !done;
        if (!BY_ONE) any_works = merge_in_teams(structure, w, clusters, request, merges, done, area_scale, left);
        else if (merges) left = merge_by_one(structure, w, clusters, request, area_scale);
        if (!any_works) break;
        if (merges) s.clusters = left;
        if (merges && request.is_whole) climbs = false;
    }
}
#endif
