// A window of H-PLOC of any size, merged by a subgroup: its clusters lie in shared memory, each looks at RADIUS on either side.
#ifndef HEDGEROW_BVH_HPLOC_TOGETHER
#define HEDGEROW_BVH_HPLOC_TOGETHER
#include "bvh/hploc_window.glsl"

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

const uint IS_WHOLE = 1u << 16;
const uint IS_WORKING = 1u << 17;

// Lanes of a subgroup; of a workgroup that is less than one, those that there are.
uint lane_count() {
    return min(gl_SubgroupSize, gl_WorkGroupSize.x);
}

// What lanes have written, to memory or to the window, the subgroup sees; and whoever is told of it afterwards.
void subgroup_step() {
    controlBarrier(gl_ScopeSubgroup, gl_ScopeDevice, gl_StorageSemanticsBuffer | gl_StorageSemanticsShared,
                   gl_SemanticsAcquireRelease | gl_SemanticsMakeAvailable | gl_SemanticsMakeVisible);
}

// Whether the cluster at place `i` is nearer to that at `own` than the one at `j` is. Of the same distance that of the least XOR:
// so of many that are all equally far from each other, those at 2k and 2k + 1 find each other.
bool is_nearer(float distance_i, uint i, float distance_j, uint j, uint own) {
    return distance_i < distance_j || (distance_i == distance_j && (i ^ own) < (j ^ own));
}

// The cluster nearest to each that is left.
void find_nearest(uint begin, uint count, float area_scale) {
    for (uint base = 0; base < count; base += lane_count()) {
        uint own = base + gl_SubgroupInvocationID;
        uint at = begin + window_left[begin + min(own, count - 1u)];
        vec3 lo = window_lo[at], hi = window_hi[at];
        uint place = at - begin;
        float best = uintBitsToFloat(0x7F800000u);
        uint nearest = own, nearest_place = place;
        // On a CPU all lanes look at the same cluster: one load instead of one a lane.
        uint from = PRIVATE_COUNTERS ? uint(max(int(base) - int(RADIUS), 0)) : 0u;
        uint turns = PRIVATE_COUNTERS ? min(base + lane_count() + RADIUS, count) - from : 2u * RADIUS + 1u;
        for (uint turn = 0; turn < turns; ++turn) {
            uint other = PRIVATE_COUNTERS ? from + turn : own + turn - RADIUS;
            // Before the first wraps around to far behind the last.
            bool looks = other < count && other != own && other + RADIUS >= own && other <= own + RADIUS;
            uint other_place = window_left[begin + (PRIVATE_COUNTERS ? other : min(other, count - 1u))];
            uint there = begin + other_place;
            float distance = distance_of(Box(lo, hi), Box(window_lo[there], window_hi[there]), area_scale);
            if (looks && is_nearer(distance, other_place, best, nearest_place, place)) {
                best = distance;
                nearest = other;
                nearest_place = other_place;
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
    uint most = most_left(request);
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

// Merges what the lanes ask for that have a request, one after the other; how many clusters are `left` to each. Whether any lane
// goes on.
bool merge_together(Structure structure, Weights w, Clusters clusters, Request request, bool merges, bool done, float area_scale,
                    out uint left) {
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
            uint left_of_lane = merge(structure, w, clusters, of_lane, area_scale);
            if (gl_SubgroupInvocationID == lane) replies[lanes + lane] = left_of_lane;
        }
    }
    left = replies[lanes + gl_SubgroupInvocationID];
    return any_works;
}
#endif
