// Merging on the device (Papay 2025, section 10.3): triangles of objects find the leaves of the static tree that they are in, and
// each such *marked* leaf is built again, as a task of the first level of a build. An object that has a tree of its own is pushed down
// the static one as a tree, many triangles at once. src/kdtree/merge/mod.rs records the phases, src/kdtree/host/marked.rs is the
// twin, bit for bit, of both ways.
//
//     setup    keeps the static tree's header                                            merge_setup.comp, merge_reset.comp
//     encode   records of all objects behind those that there are: kdtree/encode.glsl     and merge_plan.comp between
//     push     leaves of objects' trees in leaves of the static one, and pairs of         merge_seed.comp, merge_push.glsl
//              leaf and triangle there, in any order
//     find     pairs of objects without trees; all are sorted by leaf, then triangle      merge_find.comp, gpu/radix_sort
//     unique   pushed pairs are left once                                                 merge_unique.comp, merge_move.comp
//     mark     the leaves, what is known of each, a task for each                         merge_mark.comp, merge_leaves.comp,
//                                                                                         merge_describe.comp, merge_tasks.comp
//     gather   its references                                                             merge_build.glsl
//     ...      the levels and subtrees, as in a build, behind what there is
//     hook     the roots to the places of the leaves; what was there is kept              merge_build.glsl
//
// What is pushed and what is built goes by steps of which only the device knows how much they have. Each is a chain of dispatches, or
// one persistent dispatch of a task pool: merge_push_persistent.comp, merge_build_persistent.comp.
//
//   needs  one barrier between phases
#ifndef HEDGEROW_KDTREE_MERGE
#define HEDGEROW_KDTREE_MERGE
#include "kdtree/merge/state.glsl"
#include "kdtree/scan.glsl"
#include "kdtree/clip.glsl"

// Phases as the pools count them. Of a push its steps, each of which goes down in one of two trees, and what is met behind them;
// of what is built, the phases of a build from the levels on, with one before and one behind.
const uint PUSH_STEPS = 2 * KD_MAX_DEPTH + 1;
const uint PUSH_PHASES = PUSH_STEPS + 1;
const uint PHASE_GATHER = PHASE_ROOT;
const uint PHASE_HOOK = PHASE_PLACE + 1;
const uint MERGE_PHASES = PHASE_HOOK + 1;

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

// A node of the static tree, or an empty leaf, on the way down.
struct Place {
    Box cell;
    uint id;
    uint node;                      // NONE of an empty leaf
    uint depth;
};

// A node of an object's tree and how far down the static one it is.
struct KdItem {
    Place place;
    uvec2 tree;
    uint first_record;              // of the object, among those of objects
    uint node;
    Box cell;                       // of that node
};

const uint ITEM_BYTES = 76;

BUFFER KdItems { KdItem item[]; };

KdItems items_of(uint step) {
    KdMerge merge = merge_state();
    return KdItems(address_of(merge.items, (step & 1u) * merge.item_capacity, ITEM_BYTES));
}

// Leaves of objects' trees in leaves of the static one.
KdItems met_items() {
    KdMerge merge = merge_state();
    return KdItems(address_of(merge.items, 2u * merge.item_capacity, ITEM_BYTES));
}

Place root_place() {
    uint nodes = KdStructure(structure_address).header.node_count;
    return Place(merged_cell(), ROOT_ID, nodes > 0u ? 0u : NONE, 0u);
}

KdNode node_of(Place place) {
    KdNode node = KdNode(0u, KD_LEAF);
    if (place.node != NONE) node = KdStructure(structure_address).nodes[place.node];
    return node;
}

// The nodes of both children of an inner node; NONE of one that is empty.
uvec2 children_of(KdNode node) {
    bool left_is_empty = (node.second & 4u) != 0u, right_is_empty = (node.second & 8u) != 0u;
    uint child = node.second >> 4;
    return uvec2(left_is_empty ? NONE : child, right_is_empty ? NONE : child + (left_is_empty ? 0u : 1u));
}

// The places below one that is split.
void places_below(Place place, KdNode node, out Place left, out Place right) {
    left = place;
    right = place;
    half_cells(place.cell, node.second & 3u, uintBitsToFloat(node.first), left.cell, right.cell);
    uvec2 children = children_of(node);
    left.id = id_of(place.node, 0u);
    right.id = id_of(place.node, 1u);
    left.node = children.x;
    right.node = children.y;
    left.depth = place.depth + 1u;
    right.depth = place.depth + 1u;
}

// Of a tile, among the records of objects. None has any if there is not room for all.
uint first_record_of(uint tile) {
    return min(chunk_sides().side[tile].x, build_state().active_count);
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

// Leaf and record `j` of objects.
void add_pair(Place leaf, uint j) {
    KdMerge merge = merge_state();
    uint at = atomicAdd(merge.wanted_pairs, 1u);
    if (at >= merge.pair_capacity) return;
    KdPairs(merge.pairs).pair[at] = KdPair(leaf.cell.lo, leaf.node, leaf.cell.hi, leaf.depth);
    write_key(at, leaf.id, j);
    Words(merge.values).word[at] = at;
}

// Pairs, some of them several times.
uint sorted_pairs() {
    KdMerge merge = merge_state();
    return min(merge.wanted_pairs, merge.pair_capacity);
}

// Each of them once.
uint pair_count() {
    return sorted_pairs() - merge_state().equal_pairs;
}

uint id_of_key(uint i) {
    KdMerge merge = merge_state();
    Words keys = Words(merge.unique_keys);
    if (merge.key_words == 1u) return keys.word[i] >> merge.record_bits;
    uint high = merge.record_bits == 0u ? 0u : keys.word[2u * i + 1u] << 32u - merge.record_bits;
    return keys.word[2u * i] >> merge.record_bits | high;
}

uint record_of_key(uint i) {
    KdMerge merge = merge_state();
    return Words(merge.unique_keys).word[merge.key_words * i] & (1u << merge.record_bits) - 1u;
}
#endif
