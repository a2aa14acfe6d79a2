// A small window of H-PLOC, merged by one invocation: its clusters lie in registers, and each looks at all others.
#ifndef HEDGEROW_BVH_HPLOC_BY_ONE
#define HEDGEROW_BVH_HPLOC_BY_ONE
#extension GL_EXT_control_flow_attributes : require
#include "bvh/hploc/window.glsl"

// Loops over slots are unrolled, for arrays that are indexed by variables would lie in memory.
const uint SLOTS = 8;   // the WINDOW of BY_ONE, at most

Cluster slot_cluster[SLOTS];
bool slot_is_there[SLOTS];
// The distance of the nearest, and what its slot is apart from this one, by XOR; 0 if there is none.
float slot_distance[SLOTS];
uint slot_apart[SLOTS];

// Both, without a branch: 28 copies of what `&&` and `?:` make branches of are paths that a driver may follow one by one (SwiftShader).
bool both(bool a, bool b) {
    return all(bvec2(a, b));
}

// Lets two slots look at each other.
void look(uint i, uint j, float area_scale) {
    Cluster a = slot_cluster[i], b = slot_cluster[j];
    float distance = distance_of(Box(a.lo, a.hi), Box(b.lo, b.hi), area_scale);
    bool looks = both(slot_is_there[i], slot_is_there[j]);
    bool is_nearer_i = both(looks, distance < slot_distance[i]), is_nearer_j = both(looks, distance < slot_distance[j]);
    slot_distance[i] = mix(slot_distance[i], distance, is_nearer_i);
    slot_apart[i] = mix(slot_apart[i], i ^ j, is_nearer_i);
    slot_distance[j] = mix(slot_distance[j], distance, is_nearer_j);
    slot_apart[j] = mix(slot_apart[j], i ^ j, is_nearer_j);
}

// Finds the nearest of each slot. They look at each other in the order in which ties are broken. No loop: where shaderc unrolls one,
// the copies of what is `precise` are not.
void find_nearest_slots(float scale) {
    [[unroll]] for (uint i = 0; i < SLOTS; ++i) {
        slot_distance[i] = uintBitsToFloat(0x7F800000u);
        slot_apart[i] = 0u;
    }
    look(0, 1, scale); look(2, 3, scale); look(4, 5, scale); look(6, 7, scale);
    look(0, 2, scale); look(1, 3, scale); look(4, 6, scale); look(5, 7, scale);
    look(0, 3, scale); look(1, 2, scale); look(4, 7, scale); look(5, 6, scale);
    look(0, 4, scale); look(1, 5, scale); look(2, 6, scale); look(3, 7, scale);
    look(0, 5, scale); look(1, 4, scale); look(2, 7, scale); look(3, 6, scale);
    look(0, 6, scale); look(1, 7, scale); look(2, 4, scale); look(3, 5, scale);
    look(0, 7, scale); look(1, 6, scale); look(2, 5, scale); look(3, 4, scale);
}

// The slots, a bit each, that are the first of a pair in which each is the other's nearest.
uint first_slots_of_pairs() {
    uint pairs = 0u;
    [[unroll]] for (uint i = 0; i < SLOTS; ++i) {
        [[unroll]] for (uint j = i + 1u; j < SLOTS; ++j) {
            pairs |= uint(both(slot_apart[i] == (i ^ j), slot_apart[j] == (i ^ j))) << i;
        }
    }
    return pairs;
}

// Merges the pair whose first slot is `first`, which is not the last one, as the second is not the first one. A slot keeps the first position
// of its cluster, which is the merged one's: nine words are chosen and put back, not ten.
void merge_slots(Structure structure, Weights w, uint first, float area_scale) {
    Cluster left = slot_cluster[0];
    uint second = first ^ slot_apart[0];
    [[unroll]] for (uint i = 1; i < SLOTS - 1u; ++i) {
        if (first == i) {
            left = slot_cluster[i];
            second = first ^ slot_apart[i];
        }
    }
    Cluster right = slot_cluster[1];
    [[unroll]] for (uint i = 2; i < SLOTS; ++i) {
        if (second == i) right = slot_cluster[i];
    }
    Cluster merged = merge_clusters(structure, w, left, right, area_scale);
    [[unroll]] for (uint i = 0; i < SLOTS; ++i) {
        uint position = slot_cluster[i].first;
        if (first == i && i < SLOTS - 1u) slot_cluster[i] = merged;
        slot_cluster[i].first = position;
        if (second == i) slot_is_there[i] = false;
    }
}

// Merges what is asked for until at most half a window is left, or one of all; how many are left.
uint merge_by_one(Structure structure, Weights w, Clusters clusters, Request request, float area_scale) {
    uint count = request.left_count + request.right_count;
    uint most = most_left(request);
    Words list = cluster_list();
    [[unroll]] for (uint i = 0; i < SLOTS; ++i) {
        uint at = i < request.left_count ? request.left + i : request.right + (i - request.left_count);
        slot_is_there[i] = i < count;
        slot_cluster[i] = clusters.cluster[list.word[i < count ? at : request.left]];
    }
    uint merged = 0u;
    // Each round merges two at least: the nearest of all.
    for (uint round = 0; round < SLOTS && count > most; ++round) {
        find_nearest_slots(area_scale);
        uint pairs = first_slots_of_pairs();
        count -= bitCount(pairs);
        merged |= pairs;
        for (uint turn = 0; turn < SLOTS / 2u && pairs != 0u; ++turn) {
            merge_slots(structure, w, findLSB(pairs), area_scale);
            pairs &= pairs - 1u;
        }
    }
    uint place = request.left;
    [[unroll]] for (uint i = 0; i < SLOTS; ++i) {
        if (slot_is_there[i]) {
            if ((merged & 1u << i) != 0u) clusters.cluster[slot_cluster[i].first] = slot_cluster[i];
            list.word[place++] = slot_cluster[i].first;
        }
    }
    if (request.is_whole) write_root(structure, w, slot_cluster[0]);
    return count;
}
#endif
