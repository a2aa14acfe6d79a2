// A window of H-PLOC of any size, merged by a team: its clusters lie in shared memory, each looks at RADIUS on either side.
//
// A team is a part of a workgroup, and its steps are divided by the workgroup's barriers: all teams take as many, one without a
// window idles along. So nothing is asked of subgroups: neither their size, nor that they reconverge. On a GPU the workgroup of the
// hierarchy is a subgroup or two, whose barriers cost next to nothing.
#ifndef HEDGEROW_BVH_HPLOC_TEAMS
#define HEDGEROW_BVH_HPLOC_TEAMS
#include "bvh/hploc/window.glsl"

// Invocations of a team: as many as a window has places, or more; or all of the workgroup. It divides the workgroup.
layout(constant_id = 10) const uint TEAM = 8;
const uint TEAMS = gl_WorkGroupSize.x / TEAM;

// The window of each team: the boxes of its clusters and where their records lie, at fixed places; the places of those that are left,
// in order, before and after a round; for each of these, which is the nearest; and the pairs that merge.
shared vec3 window_lo[TEAMS * WINDOW];
shared vec3 window_hi[TEAMS * WINDOW];
shared uint window_first[TEAMS * WINDOW];
shared uint window_left[2 * TEAMS * WINDOW];
shared uint window_nearest[TEAMS * WINDOW];
shared uint window_pairs[TEAMS * WINDOW];
// Of those that are left, a bit each: which are the first of a pair that merges, and which are the second.
shared uint window_merges[2 * TEAMS];
shared uint window_goes[2 * TEAMS];

// What invocations ask to be merged, in any order: see `Request`. And how many clusters that left.
shared uvec3 requests[gl_WorkGroupSize.x];
shared uint replies[gl_WorkGroupSize.x];

// What invocations share at a step. There are three, so that the last but one is cleared while the next is written.
shared uint told[3];
uint step_number;

const uint IS_WHOLE = 1u << 16;
// What comes with a request: how many there are, and whether any invocation goes on.
const uint IS_WORKING = 1u << 16;

// The workgroup sees what it has written, to memory or to the windows. The lane that reports it to the device releases it there.
void team_step() {
    controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer | gl_StorageSemanticsShared,
                   gl_SemanticsAcquireRelease | gl_SemanticsMakeAvailable | gl_SemanticsMakeVisible);
}

void reset_teams() {
    for (uint i = gl_LocalInvocationIndex; i < 3u; i += gl_WorkGroupSize.x) told[i] = 0u;
    step_number = 0u;
    team_step();
}

// A step, and what was shared before it.
uint step_and_told() {
    team_step();
    uint word = told[step_number % 3u];
    // Read by all before this step, and written next after the one that follows.
    if (gl_LocalInvocationIndex == 0u) told[(step_number + 2u) % 3u] = 0u;
    step_number++;
    return word;
}

// A step, and whether any team goes on.
bool any_team(bool goes_on) {
    if (TEAMS == 1u) {
        team_step();
        return goes_on;
    }
    if (goes_on && gl_LocalInvocationIndex % TEAM == 0u) atomicOr(told[step_number % 3u], 1u);
    return step_and_told() != 0u;
}

// A team's window: which it is, the invocation's place in the team, and how many clusters there are.
struct Window {
    uint team;
    uint lane;
    uint begin;
    uint count;
    uint turn;    // in which half of `window_left` they are named
};

uint left_at(Window window, uint i) {
    return 2u * window.begin + window.turn * WINDOW + i;
}

// Whether the cluster at place `i` is nearer to that at `own` than the one at `j` is. Of the same distance that of the least XOR:
// so of many that are all equally far from each other, those at 2k and 2k + 1 find each other.
bool is_nearer(float distance_i, uint i, float distance_j, uint j, uint own) {
    return distance_i < distance_j || (distance_i == distance_j && (i ^ own) < (j ^ own));
}

// The cluster nearest to each that is left.
void find_nearest(Window window, float area_scale) {
    for (uint base = 0; base < window.count; base += TEAM) {
        uint own = base + window.lane;
        uint place = window_left[left_at(window, min(own, window.count - 1u))];
        vec3 lo = window_lo[window.begin + place], hi = window_hi[window.begin + place];
        float best = uintBitsToFloat(0x7F800000u);
        uint nearest = own, nearest_place = place;
        // On a CPU all lanes look at the same cluster: one load instead of one a lane.
        uint from = PRIVATE_COUNTERS ? uint(max(int(base) - int(RADIUS), 0)) : 0u;
        uint turns = PRIVATE_COUNTERS ? min(base + TEAM + RADIUS, window.count) - from : 2u * min(RADIUS, WINDOW) + 1u;
        for (uint turn = 0; turn < turns; ++turn) {
            uint other = PRIVATE_COUNTERS ? from + turn : own + turn - min(RADIUS, WINDOW);
            // Before the first wraps around to far behind the last.
            bool looks = other < window.count && other != own && other + RADIUS >= own && other <= own + RADIUS;
            uint other_place = window_left[left_at(window, PRIVATE_COUNTERS ? other : min(other, window.count - 1u))];
            uint there = window.begin + other_place;
            float distance = distance_of(Box(lo, hi), Box(window_lo[there], window_hi[there]), area_scale);
            if (looks && is_nearer(distance, other_place, best, nearest_place, place)) {
                best = distance;
                nearest = other;
                nearest_place = other_place;
            }
        }
        if (own < window.count) window_nearest[window.begin + own] = nearest;
    }
    for (uint i = window.lane; i < 2u; i += TEAM) {
        window_merges[2u * window.team + i] = 0u;
        window_goes[2u * window.team + i] = 0u;
    }
}

// Marks the pairs that are each other's nearest.
void mark_pairs(Window window) {
    for (uint i = window.lane; i < window.count; i += TEAM) {
        uint j = window_nearest[window.begin + i];
        bool is_mutual = window_nearest[window.begin + j] == i;
        uint word = 2u * window.team + i / 32u, bit = 1u << i % 32u;
        if (is_mutual && i < j) atomicOr(window_merges[word], bit);
        if (is_mutual && i > j) atomicOr(window_goes[word], bit);
    }
}

uint bits_below(uvec2 bits, uint i) {
    uint low = min(i, 32u), high = i - low;
    return bitCount(low < 32u ? bits.x & (1u << low) - 1u : bits.x) + bitCount(high < 32u ? bits.y & (1u << high) - 1u : bits.y);
}

// Lists the pairs, and who is left: of a pair the first. How many pairs there are.
uint list_pairs(inout Window window) {
    uint word = 2u * window.team;
    uvec2 merges = uvec2(window_merges[word], window_merges[word + 1u]), goes = uvec2(window_goes[word], window_goes[word + 1u]);
    Window next = window;
    next.turn = 1u - window.turn;
    for (uint i = window.lane; i < window.count; i += TEAM) {
        uint own = window_left[left_at(window, i)];
        uint bit = 1u << i % 32u;
        if (((i < 32u ? merges.x : merges.y) & bit) != 0u) {
            uint other = window_left[left_at(window, window_nearest[window.begin + i])];
            window_pairs[window.begin + bits_below(merges, i)] = own | other << 16;
        }
        if (((i < 32u ? goes.x : goes.y) & bit) == 0u) window_left[left_at(next, i - bits_below(goes, i))] = own;
    }
    uint pairs = bitCount(merges.x) + bitCount(merges.y);
    next.count -= pairs;
    window = next;
    return pairs;
}

void merge_pairs(Structure structure, Weights w, Clusters clusters, Window window, uint pairs, float area_scale) {
    for (uint i = window.lane; i < pairs; i += TEAM) {
        uint pair = window_pairs[window.begin + i];
        uint left = window.begin + (pair & 0xFFFFu), right = window.begin + (pair >> 16);
        Cluster c = merge_clusters(structure, w, clusters.cluster[window_first[left]], clusters.cluster[window_first[right]], area_scale);
        clusters.cluster[c.first] = c;
        window_lo[left] = c.lo;
        window_hi[left] = c.hi;
    }
}

void load_window(Clusters clusters, Words list, Request request, Window window) {
    for (uint i = window.lane; i < window.count; i += TEAM) {
        uint first = list.word[i < request.left_count ? request.left + i : request.right + (i - request.left_count)];
        window_first[window.begin + i] = first;
        window_left[left_at(window, i)] = i;
        window_lo[window.begin + i] = clusters.cluster[first].lo;
        window_hi[window.begin + i] = clusters.cluster[first].hi;
    }
}

// Each team merges what is asked for by one request from `first` on, until at most half a window is left, or one of all.
void merge_requests(Structure structure, Weights w, Clusters clusters, uint first, uint count, float area_scale) {
    uint team = gl_LocalInvocationIndex / TEAM;
    uint number = first + team;
    uvec3 asked = number < count ? requests[number] : uvec3(0u);
    Request request = Request(asked.x, asked.z & 0xFFu, asked.y, asked.z >> 8 & 0xFFu, (asked.z & IS_WHOLE) != 0u);
    Window window = Window(team, gl_LocalInvocationIndex % TEAM, team * WINDOW, request.left_count + request.right_count, 0u);
    uint most = most_left(request);
    Words list = cluster_list();
    load_window(clusters, list, request, window);
    bool goes_on = any_team(window.count > most);
    // Each round merges two at least: the nearest of all. A team that is done has no more pairs to find.
    for (uint round = 0; round < WINDOW && goes_on; ++round) {
        bool merges = window.count > most;
        if (merges) find_nearest(window, area_scale);
        team_step();
        if (merges) mark_pairs(window);
        team_step();
        uint pairs = merges ? list_pairs(window) : 0u;
        team_step();
        merge_pairs(structure, w, clusters, window, pairs, area_scale);
        goes_on = any_team(window.count > most);
    }
    for (uint i = window.lane; i < window.count; i += TEAM) {
        list.word[request.left + i] = window_first[window.begin + window_left[left_at(window, i)]];
    }
    if (window.lane == 0u && number < count) {
        replies[number] = window.count;
        if (request.is_whole) write_root(structure, w, clusters.cluster[window_first[window.begin + window_left[left_at(window, 0u)]]]);
    }
    team_step();
}

// Merges what invocations ask for that have a request; how many clusters are `left` to each. Whether any of them goes on.
bool merge_in_teams(Structure structure, Weights w, Clusters clusters, Request request, bool merges, bool done, float area_scale,
                    out uint left) {
    uint number = 0u;
    if (merges) {
        number = atomicAdd(told[step_number % 3u], 1u) & 0xFFFFu;
        uint counts = request.left_count | request.right_count << 8 | (request.is_whole ? IS_WHOLE : 0u);
        requests[number] = uvec3(request.left, request.right, counts);
    }
    if (!done) atomicOr(told[step_number % 3u], IS_WORKING);
    uint word = step_and_told();
    uint count = word & 0xFFFFu;
    for (uint first = 0; first < count; first += TEAMS) {
        merge_requests(structure, w, clusters, first, count, area_scale);
    }
    left = replies[number];
    return (word & IS_WORKING) != 0u;
}
#endif
