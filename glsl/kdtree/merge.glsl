// Merging on the device (Papay 2025, section 10.3): triangles of objects find the leaves of the static tree that they are in, and
// each such *marked* leaf is built anew, as a task of the first level of a build. src/kdtree/merge.rs records the phases,
// src/kdtree/host/marked.rs is the twin, bit for bit.
//
//     setup    keeps the static tree's header                                            merge_setup.comp, merge_reset.comp
//     encode   records of all objects behind those that there are: kdtree/encode.glsl     and merge_plan.comp between
//     find     pairs of leaf and triangle, in any order; sorted by leaf, then triangle    merge_find.comp, gpu/radix_sort
//     mark     a task for each leaf                                                       merge_mark.comp
//     gather   its references                                                             merge_gather.comp
//     ...      the levels and subtrees, as in a build, behind what there is
//     hook     the roots to the places of the leaves; what was there is kept              merge_order.comp, merge_hook.comp
//
//   needs  one barrier between phases
#ifndef HEDGEROW_KDTREE_MERGE
#define HEDGEROW_KDTREE_MERGE
#include "kdtree/merge_state.glsl"
#include "kdtree/scan.glsl"
#include "kdtree/clip.glsl"

KdMerge merge_state() {
    return KdMerge(address_of(state_address, 1u, MERGE_AT));
}

KdMarkedLeaves marked_leaves() {
    return KdMarkedLeaves(merge_state().marked);
}

// The root's cell, with what is merged.
Box merged_cell() {
    KdState state = build_state();
    KdHeader header = KdStructure(structure_address).header;
    if (state.active_count == 0u) return Box(header.lo, header.hi);
    vec3 lo = from_ordered(uvec3(state.lo[0], state.lo[1], state.lo[2]));
    vec3 hi = from_ordered(uvec3(state.hi[0], state.hi[1], state.hi[2]));
    return Box(min(header.lo, lo), max(header.hi, hi));
}

// Keys of pairs: the leaf, and below it the record among those of objects.
void write_key(uint i, uint id, uint record) {
    KdMerge merge = merge_state();
    Words keys = Words(merge.keys);
    uint low = id << merge.record_bits | record;
    if (merge.key_words == 1u) {
        keys.word[i] = low;
    } else {
        keys.word[2u * i] = low;
        keys.word[2u * i + 1u] = merge.record_bits == 0u ? 0u : id >> 32u - merge.record_bits;
    }
}

uint id_of_key(uint i) {
    KdMerge merge = merge_state();
    Words keys = Words(merge.sorted_keys);
    if (merge.key_words == 1u) return keys.word[i] >> merge.record_bits;
    uint high = merge.record_bits == 0u ? 0u : keys.word[2u * i + 1u] << 32u - merge.record_bits;
    return keys.word[2u * i] >> merge.record_bits | high;
}

uint record_of_key(uint i) {
    KdMerge merge = merge_state();
    return Words(merge.sorted_keys).word[merge.key_words * i] & (1u << merge.record_bits) - 1u;
}
#endif
