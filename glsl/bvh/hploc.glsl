// H-PLOC (Benthin et al. 2024): PLOC within each node of the radix tree, bottom-up in one pass. src/bvh/hploc.rs records it;
// src/bvh/host/hploc.rs is the twin.
//
//   hierarchy  reads the primitives, keys and values   writes nodes, root, costs, weights; scratch: clusters
//   (collapse: bvh/collapse.glsl)
//
// Each invocation climbs the radix tree from a run of positions; of two siblings the second to arrive goes on. What it meets
// there has up to half a window of clusters on either side, which lie side by side from the first position of their subtree on.
// Where they are more than half a window together, the whole subgroup merges them. The window has the same width whatever the
// subgroup's, and so the tree is the same.
//
// needs one barrier before, behind bvh/encode.glsl's phases; subgroups of any size; workgroups of whole subgroups or less than one
#ifndef HEDGEROW_BVH_HPLOC
#define HEDGEROW_BVH_HPLOC
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "bvh/clusters.glsl"
#include "bvh/radix_tree.glsl"

layout(constant_id = 7) const uint WINDOW = 32;
layout(constant_id = 8) const uint RADIUS = 8;
const uint HALF_WINDOW = WINDOW / 2;
// Levels of a radix tree: a code bit or a position bit each.
const uint LEVELS = 64 + 27;
// Subgroups of a workgroup: radix_sort::Shape.
const uint SUBGROUPS = PRIVATE_COUNTERS ? 1u : SUBGROUPS_AT_MOST;

// The window of each subgroup.
shared vec3 window_lo[SUBGROUPS * WINDOW];
shared vec3 window_hi[SUBGROUPS * WINDOW];
shared uint window_reference[SUBGROUPS * WINDOW];
shared uint window_count[SUBGROUPS * WINDOW];
shared float window_cost[SUBGROUPS * WINDOW];
shared uint window_first[SUBGROUPS * WINDOW];
shared uint window_nearest[SUBGROUPS * WINDOW];

// Left children that wait for a sibling out of the same run of positions (bvh/lbvh.glsl), and their clusters.
shared uint run_firsts[ITEMS * gl_WorkGroupSize.x];
shared uint run_clusters[ITEMS * gl_WorkGroupSize.x];

// Lanes of a subgroup; of a workgroup that is less than one, those that there are.
uint lane_count() {
    return min(gl_SubgroupSize, gl_WorkGroupSize.x);
}

uint run_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

// What lanes have written, to memory or to the window, the subgroup sees; and whoever is told of it afterwards.
void subgroup_step() {
    controlBarrier(gl_ScopeSubgroup, gl_ScopeDevice, gl_StorageSemanticsBuffer | gl_StorageSemanticsShared,
                   gl_SemanticsAcquireRelease | gl_SemanticsMakeAvailable | gl_SemanticsMakeVisible);
}

// The end of a subtree and how many clusters it has, in a word: positions have 27 bits.
uint packed_end(uint end, uint clusters) {
    return end | (clusters - 1u) << 27;
}

// A subtree over the positions first..=last, and how the codes differ before and behind it.
struct Range {
    uint first;
    uint last;
    uint clusters;
    uvec3 before;
    uvec3 behind;
};

// Two lists of clusters side by side in the window: from `left` on, then from `right` on.
struct Lists {
    uint left;
    uint left_count;
    uint right;
    uint right_count;
};

Cluster in_window(uint at) {
    return Cluster(window_lo[at], window_reference[at], window_hi[at], window_count[at], window_cost[at], window_first[at]);
}

void to_window(uint at, Cluster c) {
    window_lo[at] = c.lo;
    window_reference[at] = c.reference;
    window_hi[at] = c.hi;
    window_count[at] = c.count;
    window_cost[at] = c.cost;
    window_first[at] = c.first;
}

// The cluster nearest to each of the window's; ties to the one before.
void find_nearest(uint begin, uint count, float area_scale) {
    for (uint base = 0; base < count; base += lane_count()) {
        uint own = base + gl_SubgroupInvocationID;
        uint at = begin + min(own, count - 1u);
        vec3 lo = window_lo[at], hi = window_hi[at];
        float best = uintBitsToFloat(0x7F800000u);
        uint nearest = own;
        // On a CPU all lanes look at the same cluster: one load instead of one a lane.
        uint from = PRIVATE_COUNTERS ? uint(max(int(base) - int(RADIUS), 0)) : 0u;
        uint turns = PRIVATE_COUNTERS ? min(base + lane_count() + RADIUS, count) - from : 2u * RADIUS + 1u;
        for (uint turn = 0; turn < turns; ++turn) {
            uint other = PRIVATE_COUNTERS ? from + turn : own + turn - RADIUS;
            // Before the first wraps around to far behind the last.
            bool looks = other < count && other != own && other + RADIUS >= own && other <= own + RADIUS;
            uint there = begin + min(other, count - 1u);
            float distance = scaled_half_area(Box(min(lo, window_lo[there]), max(hi, window_hi[there])), area_scale);
            if (looks && distance < best) {
                best = distance;
                nearest = other;
            }
        }
        if (own < count) window_nearest[at] = nearest;
    }
    subgroup_step();
}

// A round of PLOC; how many clusters are left.
uint merge_round(Structure structure, Weights w, uint begin, uint count, float area_scale) {
    find_nearest(begin, count, area_scale);
    uint left = 0;
    for (uint base = 0; base < count; base += lane_count()) {
        uint own = base + gl_SubgroupInvocationID;
        bool stays = own < count;
        Cluster c;
        if (stays) {
            c = in_window(begin + own);
            uint other = window_nearest[begin + own];
            bool mutual = window_nearest[begin + other] == own;
            if (mutual && own < other) c = merge_clusters(structure, w, c, in_window(begin + other), area_scale);
            stays = !mutual || own < other;
        }
        uvec4 staying = subgroupBallot(stays);
        subgroup_step();
        // To the places of clusters that all lanes have read.
        if (stays) to_window(begin + left + subgroupBallotExclusiveBitCount(staying), c);
        left += subgroupBallotBitCount(staying);
        subgroup_step();
    }
    return left;
}

// Merges two lists until at most `most` clusters are left, and writes them from the left list's place on; how many they are.
uint merge_lists(Structure structure, Weights w, Clusters clusters, Lists lists, uint most, float area_scale) {
    uint begin = gl_SubgroupID * WINDOW;
    uint count = lists.left_count + lists.right_count;
    subgroup_step();
    for (uint i = gl_SubgroupInvocationID; i < count; i += lane_count()) {
        uint place = i < lists.left_count ? lists.left + i : lists.right + (i - lists.left_count);
        to_window(begin + i, clusters.cluster[place]);
    }
    subgroup_step();
    // Each round merges two at least: the nearest of all.
    for (uint round = 0; round < WINDOW && count > most; ++round) {
        count = merge_round(structure, w, begin, count, area_scale);
    }
    for (uint i = gl_SubgroupInvocationID; i < count; i += lane_count()) {
        clusters.cluster[lists.left + i] = in_window(begin + i);
    }
    if (most == 1u && gl_SubgroupInvocationID == 0u) write_root(structure, w, in_window(begin));
    subgroup_step();
    return count;
}

bool is_whole(Range s, uint active_count) {
    return s.first == 0u && s.last + 1u == active_count;
}

// One step up from a subtree: whether its sibling is there. If so, `s` becomes their parent, and the clusters of both are told.
bool step_up(Words codes, uint active_count, uint run, inout uint waiting, inout Range s, out Lists lists) {
    lists = Lists(s.first, s.clusters, s.first, 0u);
    Words ends = Words(ends_address);
    bool is_left = is_less(s.behind, s.before);
    uint parent = is_left ? s.last : s.first - 1u;
    uint end, clusters;
    if (is_left && s.first >= run) {
        run_firsts[run_slot(waiting)] = s.first;
        run_clusters[run_slot(waiting)] = s.clusters;
        waiting++;
        return false;
    }
    if (!is_left && waiting > 0u) {
        waiting--;
        end = run_firsts[run_slot(waiting)];
        clusters = run_clusters[run_slot(waiting)];
    } else {
        release_to_device();
        uint word = atomicExchange(ends.word[parent], packed_end(is_left ? s.first : s.last, s.clusters));
        if (word == NONE) return false;
        acquire_from_device();
        end = word & (1u << 27) - 1u;
        clusters = (word >> 27) + 1u;
    }
    if (is_left) {
        lists = Lists(s.first, s.clusters, s.last + 1u, clusters);
        s.last = end;
        s.behind = difference_behind(codes, s.last, active_count);
    } else {
        lists = Lists(end, clusters, s.first, s.clusters);
        s.first = end;
        s.before = difference_before(codes, s.first);
    }
    s.clusters += clusters;
    return true;
}

void hploc_hierarchy(uint task) {
    BuildState state = BuildState(state_address);
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Clusters clusters = Clusters(scratch_behind_weights());
    Geometry input_geometries = geometries();
    Words codes = Words(keys[passes & 1u]);
    uint active_count = state.active_count;
    float area_scale = state.plan.area_scale;
    uint run = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    uint end = min(run + ITEMS, active_count);
    uint position = run;
    uint waiting = 0;
    bool leaves_done = false, climbs = false, done = false;
    uint own_run = run;
    Range s;
    // Each turn, each lane goes up a level, or takes what is next of its run.
    for (uint turn = 0; turn < (ITEMS + 1u) * (LEVELS + 1u); ++turn) {
        bool merges = false;
        Lists lists = Lists(0u, 0u, 0u, 0u);
        if (climbs) {
            climbs = step_up(codes, active_count, own_run, waiting, s, lists);
            // Where they lie side by side and are few, nothing needs to be done.
            merges = climbs && (s.clusters > HALF_WINDOW || lists.left + lists.left_count != lists.right || is_whole(s, active_count));
        } else if (position < end) {
            clusters.cluster[position] = cluster_of_primitive(input_geometries, position, area_scale);
            s = Range(position, position, 1u, difference_before(codes, position), difference_behind(codes, position, active_count));
            lists = Lists(position, 1u, position, 0u);
            climbs = true;
            merges = is_whole(s, active_count);
            position++;
        } else if (waiting > 0u) {
            own_run = NONE;
            uint last = (leaves_done ? run_firsts[run_slot(waiting)] : end) - 1u;
            leaves_done = true;
            waiting--;
            uint first = run_firsts[run_slot(waiting)];
            s = Range(first, last, run_clusters[run_slot(waiting)], difference_before(codes, first),
                      difference_behind(codes, last, active_count));
            climbs = true;
        } else {
            done = true;
        }
        uvec4 merging = subgroupBallot(merges);
        uint lanes = subgroupBallotBitCount(merging);
        for (uint k = 0; k < lanes; ++k) {
            uint lane = subgroupBallotFindLSB(merging);
            merging[lane >> 5] &= merging[lane >> 5] - 1u;
            Lists of_lane = Lists(subgroupShuffle(lists.left, lane), subgroupShuffle(lists.left_count, lane),
                                  subgroupShuffle(lists.right, lane), subgroupShuffle(lists.right_count, lane));
            bool whole = subgroupShuffle(is_whole(s, active_count) ? 1u : 0u, lane) != 0u;
            uint left = merge_lists(structure, w, clusters, of_lane, whole ? 1u : HALF_WINDOW, area_scale);
            if (gl_SubgroupInvocationID == lane) {
                s.clusters = left;
                if (whole) climbs = false;
            }
        }
        if (!subgroupAny(!done)) break;
    }
}
#endif
