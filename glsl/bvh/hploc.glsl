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
#include "bvh/clusters.glsl"
#include "bvh/radix_tree.glsl"

layout(constant_id = 6) const uint WINDOW = 32;
layout(constant_id = 7) const uint RADIUS = 8;
const uint HALF_WINDOW = WINDOW / 2;
// Levels of a radix tree: a code bit or a position bit each.
const uint LEVELS = 64 + 27;
// Subgroups of a workgroup: radix_sort::Shape.
const uint SUBGROUPS = PRIVATE_COUNTERS ? 1u : SUBGROUPS_AT_MOST;

// The window of each subgroup: the boxes of its clusters and where their records lie, at fixed places; the places of those that
// are left, in order; for each of these, which is the nearest; and the pairs that merge.
shared vec3 window_lo[SUBGROUPS * WINDOW];
shared vec3 window_hi[SUBGROUPS * WINDOW];
shared uint window_first[SUBGROUPS * WINDOW];
shared uint window_left[SUBGROUPS * WINDOW];
shared uint window_nearest[SUBGROUPS * WINDOW];
shared uint window_pairs[SUBGROUPS * WINDOW];

// What each invocation asks its subgroup to merge: see `Request`.
shared uvec3 requests[gl_WorkGroupSize.x];
// How many clusters that left.
shared uint replies[gl_WorkGroupSize.x];

// Left children that wait for a sibling out of the same run of positions (bvh/lbvh.glsl), and their clusters.
shared uint run_firsts[ITEMS * gl_WorkGroupSize.x];
shared uint run_clusters[ITEMS * gl_WorkGroupSize.x];

uint run_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

// Lanes of a subgroup; of a workgroup that is less than one, those that there are.
uint lane_count() {
    return min(gl_SubgroupSize, gl_WorkGroupSize.x);
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

// The clusters of two siblings: their records are named by the list from `left` and from `right` on.
struct Request {
    uint left;
    uint left_count;
    uint right;
    uint right_count;
    bool is_whole;    // they are all that there are
};

const Request NO_REQUEST = Request(0u, 0u, 0u, 0u, false);
const uint IS_WHOLE = 1u << 16;
const uint IS_WORKING = 1u << 17;

// Where the records of a subtree's clusters lie, from its first position on. The sort has left the memory free.
Words cluster_list() {
    return Words(keys[1u - (passes & 1u)]);
}

// The cluster nearest to each that is left; ties to the one before.
void find_nearest(uint begin, uint count, float area_scale) {
    for (uint base = 0; base < count; base += lane_count()) {
        uint own = base + gl_SubgroupInvocationID;
        uint at = begin + window_left[begin + min(own, count - 1u)];
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
            uint there = begin + window_left[begin + (PRIVATE_COUNTERS ? other : min(other, count - 1u))];
            float distance = scaled_half_area(Box(min(lo, window_lo[there]), max(hi, window_hi[there])), area_scale);
            if (looks && distance < best) {
                best = distance;
                nearest = other;
            }
        }
        if (own < count) window_nearest[begin + own] = nearest;
    }
    subgroup_step();
}

// Finds the pairs that are each other's nearest and leaves the first of each; how many are left, and how many pairs there are.
uvec2 find_pairs(uint begin, uint count) {
    uvec2 found = uvec2(0);
    if (PRIVATE_COUNTERS) {
        // One after the other: ballots are loops on a CPU.
        for (uint i = 0; i < count; ++i) {
            uint j = window_nearest[begin + i], own = window_left[begin + i];
            bool mutual = window_nearest[begin + j] == i;
            if (gl_SubgroupInvocationID == 0u) {
                if (mutual && i < j) window_pairs[begin + found.y] = own | window_left[begin + j] << 16;
                if (!mutual || i < j) window_left[begin + found.x] = own;
            }
            found += uvec2(!mutual || i < j ? 1u : 0u, mutual && i < j ? 1u : 0u);
        }
    } else {
        for (uint base = 0; base < count; base += lane_count()) {
            uint i = base + gl_SubgroupInvocationID;
            uint j = i < count ? window_nearest[begin + i] : 0u, own = i < count ? window_left[begin + i] : 0u;
            bool mutual = i < count && window_nearest[begin + j] == i;
            uint other = window_left[begin + j];
            bool merges = mutual && i < j, stays = i < count && (!mutual || i < j);
            uvec4 merging = subgroupBallot(merges), staying = subgroupBallot(stays);
            subgroup_step();
            // To places that all lanes have read.
            if (merges) window_pairs[begin + found.y + subgroupBallotExclusiveBitCount(merging)] = own | other << 16;
            if (stays) window_left[begin + found.x + subgroupBallotExclusiveBitCount(staying)] = own;
            found += uvec2(subgroupBallotBitCount(staying), subgroupBallotBitCount(merging));
            subgroup_step();
        }
    }
    subgroup_step();
    return found;
}

// Merges what is asked for until at most half a window is left, or one of all; how many are left.
uint merge(Structure structure, Weights w, Clusters clusters, Request request, float area_scale) {
    uint begin = gl_SubgroupID * WINDOW;
    uint count = request.left_count + request.right_count;
    uint most = request.is_whole ? 1u : HALF_WINDOW;
    Words list = cluster_list();
    subgroup_step();
    for (uint i = gl_SubgroupInvocationID; i < count; i += lane_count()) {
        uint first = list.word[i < request.left_count ? request.left + i : request.right + (i - request.left_count)];
        window_first[begin + i] = first;
        window_left[begin + i] = i;
        window_lo[begin + i] = clusters.cluster[first].lo;
        window_hi[begin + i] = clusters.cluster[first].hi;
    }
    subgroup_step();
    // Each round merges two at least: the nearest of all.
    for (uint round = 0; round < WINDOW && count > most; ++round) {
        find_nearest(begin, count, area_scale);
        uvec2 found = find_pairs(begin, count);
        count = found.x;
        for (uint i = gl_SubgroupInvocationID; i < found.y; i += lane_count()) {
            uint pair = window_pairs[begin + i];
            uint left = begin + (pair & 0xFFFFu), right = begin + (pair >> 16);
            Cluster c = merge_clusters(structure, w, clusters.cluster[window_first[left]],
                                       clusters.cluster[window_first[right]], area_scale);
            clusters.cluster[c.first] = c;
            window_lo[left] = c.lo;
            window_hi[left] = c.hi;
        }
        subgroup_step();
    }
    for (uint i = gl_SubgroupInvocationID; i < count; i += lane_count()) {
        list.word[request.left + i] = window_first[begin + window_left[begin + i]];
    }
    if (request.is_whole && gl_SubgroupInvocationID == 0u) {
        write_root(structure, w, clusters.cluster[window_first[begin + window_left[begin]]]);
    }
    subgroup_step();
    return count;
}

bool is_whole(Range s, uint active_count) {
    return s.first == 0u && s.last + 1u == active_count;
}

// One step up from a subtree: whether its sibling is there. If so, `s` becomes their parent, and the clusters of both are told.
bool step_up(Words codes, uint active_count, uint run, inout uint waiting, inout Range s, out Request request) {
    request = NO_REQUEST;
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
        request = Request(s.first, s.clusters, s.last + 1u, clusters, false);
        s.last = end;
        s.behind = difference_behind(codes, s.last, active_count);
    } else {
        request = Request(end, clusters, s.first, s.clusters, false);
        s.first = end;
        s.before = difference_before(codes, s.first);
    }
    s.clusters += clusters;
    request.is_whole = is_whole(s, active_count);
    return true;
}

void hploc_hierarchy(uint task) {
    BuildState state = BuildState(state_address);
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Clusters clusters = Clusters(scratch_behind_weights());
    Words list = cluster_list();
    Geometry input_geometries = geometries();
    Words codes = Words(keys[passes & 1u]);
    uint active_count = state.active_count;
    float area_scale = state.plan.area_scale;
    uint run = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    uint end = min(run + ITEMS, active_count);
    for (uint position = run; position < end; ++position) {
        clusters.cluster[position] = cluster_of_primitive(input_geometries, position, area_scale);
        list.word[position] = position;
    }
    uint position = run;
    uint waiting = 0;
    bool leaves_done = false, climbs = false;
    uint own_run = run;
    Range s;
    // Each invocation goes as far as it can alone; then the subgroup merges for all.
    for (uint turn = 0; turn < (ITEMS + 1u) * (LEVELS + 1u); ++turn) {
        Request request = NO_REQUEST;
        bool merges = false, done = false;
        for (uint steps = 0; steps < (ITEMS + 1u) * (LEVELS + 1u) && !merges && !done; ++steps) {
            if (climbs) {
                climbs = step_up(codes, active_count, own_run, waiting, s, request);
                // Where they lie side by side and are few, nothing needs to be done.
                merges = climbs && (s.clusters > HALF_WINDOW || request.left + request.left_count != request.right || request.is_whole);
            } else if (position < end) {
                s = Range(position, position, 1u, difference_before(codes, position), difference_behind(codes, position, active_count));
                request = Request(position, 1u, position, 0u, is_whole(s, active_count));
                climbs = true;
                merges = request.is_whole;
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
        }
        uint counts = merges ? request.left_count | request.right_count << 8 | (request.is_whole ? IS_WHOLE : 0u) : 0u;
        uint lanes = gl_SubgroupID * lane_count();
        requests[lanes + gl_SubgroupInvocationID] = uvec3(request.left, request.right, counts | (done ? 0u : IS_WORKING));
        subgroup_step();
        bool any_works = false;
        for (uint lane = 0; lane < lane_count(); ++lane) {
            uvec3 asked = requests[lanes + lane];
            any_works = any_works || (asked.z & IS_WORKING) != 0u;
            if ((asked.z & 0xFFFFu) != 0u) {
                Request of_lane = Request(asked.x, asked.z & 0xFFu, asked.y, asked.z >> 8 & 0xFFu, (asked.z & IS_WHOLE) != 0u);
                uint left = merge(structure, w, clusters, of_lane, area_scale);
                if (gl_SubgroupInvocationID == lane) replies[lanes + lane] = left;
            }
        }
        if (!any_works) break;
        if (merges) s.clusters = replies[lanes + gl_SubgroupInvocationID];
        if (merges && request.is_whole) climbs = false;
    }
}
#endif
