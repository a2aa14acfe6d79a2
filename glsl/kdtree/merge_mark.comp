#version 460
// A task of the first level for each leaf that triangles of objects are in; one workgroup. See kdtree/merge.glsl.
//
// What does not fit is not merged at all: the static tree stays as it is, and the status says so.
#include "kdtree/merge.glsl"

// The leaf of this number if it is marked, otherwise NONE; leaves are in order.
uint find_marked(uint id, uint marked) {
    KdMarkedLeaves leaves = marked_leaves();
    uint at = 0, end = marked;
    for (uint halving = 0; halving < 32 && at < end; ++halving) {
        uint middle = at + (end - at) / 2;
        if (leaves.leaf[middle].id < id) at = middle + 1u;
        else end = middle;
    }
    return at < marked && leaves.leaf[at].id == id ? at : NONE;
}

// Writes the numbers and first pairs of the leaves; how many they are.
uint mark(uint pairs) {
    KdMerge merge = merge_state();
    KdMarkedLeaves leaves = marked_leaves();
    uint marked = 0;
    for (uint base = 0; base < pairs; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex, total;
        bool is_first = i < pairs && (i == 0u || id_of_key(i) != id_of_key(i - 1u));
        uint at = marked + sum_before(is_first ? 1u : 0u, total);
        if (is_first && at < merge.marked_capacity) {
            leaves.leaf[at].id = id_of_key(i);
            leaves.leaf[at].first = i;
        }
        marked += total;
    }
    return marked;
}

// Of all marked leaves: references, those of the static tree among them, and how many are empty, the root apart.
struct Wanted {
    uint references;
    uint own;
    uint empty;
};

Wanted describe(uint marked, uint pairs) {
    KdMerge merge = merge_state();
    KdMarkedLeaves leaves = marked_leaves();
    KdStructure structure = KdStructure(structure_address);
    uint first_pair = structure.header.node_count;
    Wanted wanted = Wanted(0u, 0u, 0u);
    for (uint base = 0; base < marked; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        bool is_there = i < marked;
        KdMarked leaf = leaves.leaf[min(i, marked - 1u)];
        leaf.node = KdPairs(merge.pairs).pair[Words(merge.sorted_values).word[leaf.first]].node;
        KdNode node = kd_leaf(0u, 0u);
        if (leaf.node != NONE) node = structure.nodes[leaf.node];
        bool is_empty = leaf.node == NONE && leaf.id != ROOT_ID;
        leaf.own = node.first;
        leaf.from = node.second >> 2;
        leaf.count = leaf.own + (i + 1u < marked ? leaves.leaf[i + 1u].first : pairs) - leaf.first;
        leaf.home = is_empty ? leaf.id - 1u >> 1 : leaf.node;
        leaf.copies = 1u;
        Wanted total;
        leaf.begin = wanted.references + sum_before(is_there ? leaf.count : 0u, total.references);
        leaf.pair = first_pair + 2u * (wanted.empty + sum_before(is_there && is_empty ? 1u : 0u, total.empty));
        sum_before(is_there ? leaf.own : 0u, total.own);
        if (is_there) leaves.leaf[i] = leaf;
        wanted = Wanted(wanted.references + total.references, wanted.own + total.own, wanted.empty + total.empty);
    }
    return wanted;
}

// The sibling of an empty leaf moves beside it. If it is a marked leaf, or the parent of one that is empty, that one writes it there.
void move_siblings(uint marked) {
    KdMarkedLeaves leaves = marked_leaves();
    KdStructure structure = KdStructure(structure_address);
    for (uint i = gl_LocalInvocationIndex; i < marked; i += gl_WorkGroupSize.x) {
        KdMarked leaf = leaves.leaf[i];
        if (leaf.node != NONE || leaf.id == ROOT_ID) continue;
        uint parent = leaf.id - 1u >> 1, side = leaf.id - 1u & 1u;
        uint sibling = structure.nodes[parent].second >> 4;
        KdNode node = structure.nodes[sibling];
        uint writer = NONE;
        if (kd_is_leaf(node)) writer = find_marked(id_of(parent, 1u - side), marked);
        else if ((node.second & 12u) != 0u) writer = find_marked(id_of(sibling, (node.second & 4u) != 0u ? 0u : 1u), marked);
        if (writer != NONE) {
            leaves.leaf[writer].home = leaf.pair + 1u - side;
            leaves.leaf[i].copies = 0u;
        }
    }
}

void main() {
    KdState state = build_state();
    KdMerge merge = merge_state();
    KdStructure structure = KdStructure(structure_address);
    uint pairs = pair_count();
    uint wanted_marked = mark(pairs), marked = min(wanted_marked, merge.marked_capacity);
    next_step();
    Wanted wanted = describe(marked, pairs);
    bool fits = merge.status == 0u && merge.wanted_pairs <= merge.pair_capacity && wanted_marked <= merge.marked_capacity
        && wanted.references <= reference_capacity && state.leaf_count + wanted.references <= cut_room
        && state.node_count + 2u * wanted.empty + marked <= level_node_room && marked <= task_capacity
        && marked <= subtree_capacity;
    next_step();
    if (fits) move_siblings(marked);
    else marked = 0u;
    uint base_node = state.node_count + (fits ? 2u * wanted.empty : 0u);
    next_step();
    if (gl_LocalInvocationIndex == 0u) {
        if (!fits) {
            merge.status |= STATUS_OUT_OF_ROOM;
            state.status |= STATUS_OUT_OF_ROOM;
            state.active_count = 0u;
        }
        Box cell = merged_cell();
        state.cell_lo = cell.lo;
        state.cell_hi = cell.hi;
        state.area_scale = state.active_count > 0u ? area_scale_of(cell) : structure.header.area_scale;
        state.node_count = base_node;
        state.most_references = wanted.references;
        state.most_cut = state.leaf_count + wanted.references;
        state.most_nodes = base_node + wanted_marked + (fits ? 0u : 2u * wanted.empty);
        state.most_subtrees = wanted_marked;
        merge.wanted_marked = wanted_marked;
        merge.wanted_references = wanted.references;
        merge.marked_count = marked;
        merge.marked_empty = fits ? wanted.empty : 0u;
        merge.marked_root = marked > 0u && structure.header.node_count == 0u ? 1u : 0u;
        merge.replaced_references = fits ? wanted.own : 0u;
        merge.first_root = base_node;
        KdUndo(merge.undo).count = marked;
        PoolState pool = PoolState(state_address);
        pool_reset(pool, MERGE_PHASES);
        pool.tasks[PHASE_GATHER] = marked;
        pool.tasks[PHASE_ORDER] = 1u;
        pool.tasks[PHASE_HOOK] = (marked + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
    }
    next_step();
    KdMarkedLeaves leaves = marked_leaves();
    Sums sums = Sums(0u, 0u, 0u, 0u, 0u);
    for (uint base = 0; base < marked; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        KdMarked leaf = leaves.leaf[min(i, marked - 1u)];
        KdPair pair = KdPairs(merge.pairs).pair[Words(merge.sorted_values).word[leaf.first]];
        Box cell = Box(pair.lo, pair.hi);
        KdTask none = new_task(cell, 0u, 0u, 0u), task = none;
        if (i < marked) task = new_task(cell, leaf.begin, leaf.count, pair.depth);
        write_tasks(0u, task, none, sums);
    }
    next_step();
    publish_level(0u, sums, fits ? wanted.references : 0u);
}
