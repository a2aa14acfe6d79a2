// PLOC (Meister and Bittner 2018): in rounds, clusters that are each other's nearest within RADIUS places become one.
// src/bvh/ploc.rs records it; src/bvh/twin/ploc.rs is the twin and says what the paper leaves open.
//
//   begin    reads the primitives, keys, values      writes clusters, list[0], the first round's count
//   search   reads list[round], clusters             writes nearest
//   count    reads nearest                           writes sums: clusters that are left of each tile
//   scan     reads sums                              writes sums (exclusive), the next round's count; one workgroup
//   merge    reads list[round], nearest, sums        writes clusters, nodes, weights, list[round + 1]
//   finish   rounds until one cluster is left        the root; one workgroup
//   (collapse: bvh/collapse.glsl)
//
// A round of fewer clusters than there are tiles for does nothing in the others: how many rounds are recorded follows from the
// number of primitives, and what they leave, however many they are, is for `finish`.
//
// needs one barrier between each two, and before the first; subgroups of any size; workgroups of whole subgroups or less than one
#ifndef HEDGEROW_BVH_PLOC
#define HEDGEROW_BVH_PLOC
#include "bvh/clusters.glsl"
#include "bvh/tiles.glsl"

// Neighbours on either side that a cluster looks at; whether boxes are cached in shared memory << 16.
layout(constant_id = 7) const uint RADIUS_WORD = 16;
const uint RADIUS = RADIUS_WORD & 0xFFFFu;
const bool CACHES = RADIUS_WORD >> 16 != 0u;
// Clusters that rounds may look at before merges are forced: this many per primitive, and a fixed number.
const uint LOOKS = 16;
const uint LOOKS_ANYWAY = 1u << 17;
// A round is slow if fewer than one in this many clusters merges.
const uint SLOW = 16;
const uint CACHED = CACHES ? gl_WorkGroupSize.x + 2u * RADIUS : 1u;

// On a GPU, the boxes of a tile and of what is near it.
shared vec3 cached_lo[CACHED];
shared vec3 cached_hi[CACHED];

// Where the records of the clusters of a round lie, in order.
Words cluster_list(uint round) {
    return Words(part(parts.lists[round & 1u]));
}

Words nearest_of() {
    return Words(part(parts.nearest));
}

uint clusters_in(uint round) {
    return build_state().cluster_counts[round & 1u];
}

// ---- begin ----

void ploc_begin(uint task) {
    BuildState state = build_state();
    Clusters clusters = all_clusters();
    Geometry input_geometries = geometries();
    if (task == 0u && gl_LocalInvocationIndex == 0u) {
        state.cluster_counts[0] = state.active_count;
        state.is_forced[0] = 0;
        state.looks = 0;
    }
    uint first = task * tile_size() + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint position = first + k * gl_WorkGroupSize.x;
        if (position < state.active_count) {
            clusters.cluster[position] = cluster_of_primitive(input_geometries, position, state.plan.area_scale);
            cluster_list(0).word[position] = position;
        }
    }
}

// ---- search ----

Box box_of_cluster(Words list, Clusters clusters, uint i) {
    uint first = listed(list, i);
    return Box(clusters.cluster[first].lo, clusters.cluster[first].hi);
}

void ploc_search(uint task, uint round) {
    uint count = clusters_in(round);
    Words list = cluster_list(round), nearest = nearest_of();
    Clusters clusters = all_clusters();
    float area_scale = build_state().plan.area_scale;
    for (uint k = 0; k < ITEMS; ++k) {
        uint begin = task * tile_size() + k * gl_WorkGroupSize.x;
        if (begin >= count) break;
        uint own = begin + gl_LocalInvocationIndex;
        if (CACHES) {
            barrier();
            for (uint i = gl_LocalInvocationIndex; i < CACHED; i += gl_WorkGroupSize.x) {
                uint other = begin + i - RADIUS;
                if (other < count) {
                    Box b = box_of_cluster(list, clusters, other);
                    cached_lo[i] = b.lo;
                    cached_hi[i] = b.hi;
                }
            }
            barrier();
        }
        Box mine = box_of_cluster(list, clusters, min(own, count - 1u));
        float best = uintBitsToFloat(0x7F800000u);
        uint best_other = own;
        // Without a cache all lanes look at the same cluster: one load instead of one a lane.
        uint from = CACHES ? 0u : uint(max(int(begin) - int(RADIUS), 0));
        uint turns = CACHES ? 2u * RADIUS + 1u : min(begin + gl_WorkGroupSize.x + RADIUS, count) - from;
        for (uint turn = 0; turn < turns; ++turn) {
            uint other = CACHES ? own + turn - RADIUS : from + turn;
            // Before the first wraps around to far behind the last.
            bool looks = other < count && other != own && other + RADIUS >= own && other <= own + RADIUS;
            Box theirs;
            if (CACHES) {
                uint cached = gl_LocalInvocationIndex + turn;
                theirs = Box(cached_lo[cached], cached_hi[cached]);
            } else {
                theirs = box_of_cluster(list, clusters, other);
            }
            float distance = distance_of(mine, theirs, area_scale);
            if (looks && distance < best) {
                best = distance;
                best_other = other;
            }
        }
        if (own < count) nearest.word[own] = best_other;
    }
}

// ---- count, scan, merge ----

// The cluster that merges with the one at `i`, or `i`.
uint partner_of(Words nearest, uint i, uint count, bool is_forced) {
    uint j = nearest.word[i];
    if (nearest.word[j] == i) return j;
    uint other = i ^ 1u;
    if (!is_forced || other >= count) return i;
    return nearest.word[nearest.word[other]] == other ? i : other;
}

// How many of this invocation's strip of the tile are left.
uint left_of_strip(uint task, uint round) {
    uint count = clusters_in(round);
    bool is_forced = build_state().is_forced[round & 1u] != 0u;
    Words nearest = nearest_of();
    uint begin = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    uint left = 0;
    for (uint i = begin; i < min(begin + ITEMS, count); ++i) left += partner_of(nearest, i, count, is_forced) >= i ? 1u : 0u;
    return left;
}

void ploc_count(uint task, uint round) {
    write_tile_sum(task, left_of_strip(task, round));
}

void ploc_scan(uint round) {
    BuildState state = build_state();
    uint count = clusters_in(round);
    uint total = scan_tiles(tiles_of(count));
    if (gl_LocalInvocationIndex == 0u) {
        uint next = (round + 1u) & 1u;
        // There are at most 2^27 primitives; behind the most looks every second round leaves at most three quarters.
        uint looks = state.looks + count;
        bool is_late = looks > LOOKS * state.active_count + LOOKS_ANYWAY;
        state.looks = looks;
        state.cluster_counts[next] = total;
        state.is_forced[next] = is_late && SLOW * (count - total) < count ? 1u : 0u;
    }
}

void ploc_merge(uint task, uint round) {
    BuildState state = build_state();
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Clusters clusters = all_clusters();
    uint count = clusters_in(round);
    bool is_forced = state.is_forced[round & 1u] != 0u;
    Words list = cluster_list(round), next = cluster_list(round + 1u), nearest = nearest_of();
    uint total;
    uint place = sums_of_tiles().word[task] + sum_before(left_of_strip(task, round), total);
    uint begin = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    for (uint i = begin; i < min(begin + ITEMS, count); ++i) {
        uint partner = partner_of(nearest, i, count, is_forced);
        uint first = list.word[i];
        if (partner > i) {
            uint other = list.word[partner];
            clusters.cluster[first] = merge_clusters(structure, w, clusters.cluster[first], clusters.cluster[other], state.plan.area_scale);
        }
        if (partner >= i) next.word[place++] = first;
    }
}

// ---- finish ----

// `round` is the first that is not done yet.
void ploc_finish(uint round) {
    // Where nothing is written, no workgroup has begun.
    uint count = primitive_count == 0u ? 0u : clusters_in(round);
    // Until rounds are forced there can be 512 of at least 256 clusters, and later every second leaves fifteen of sixteen.
    // Once at least, which changes nothing where there is one cluster or none: Mesa 26's lavapipe goes through a loop that no lane
    // enters, and loads from null.
    for (uint turn = 0; turn < 1024u && (turn == 0u || count > 1u); ++turn, ++round) {
        uint tiles = max(tiles_of(count), 1u);
        for (uint task = 0; task < tiles; ++task) ploc_search(task, round);
        next_phase();
        for (uint task = 0; task < tiles; ++task) ploc_count(task, round);
        next_phase();
        ploc_scan(round);
        next_phase();
        for (uint task = 0; task < tiles; ++task) ploc_merge(task, round);
        next_phase();
        count = clusters_in(round + 1u);
    }
    if (gl_LocalInvocationIndex == 0u && count == 1u) {
        write_root(Structure(structure_address), weights(), all_clusters().cluster[listed(cluster_list(round), 0u)]);
    }
}
#endif
