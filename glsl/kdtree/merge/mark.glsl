// From sorted pairs to a task of the first level for each leaf that triangles of objects are in. See kdtree/merge.glsl.
//
// What does not fit is not merged at all: the static tree stays as it is, and the status says so.
#ifndef HEDGEROW_KDTREE_MERGE_MARK
#define HEDGEROW_KDTREE_MERGE_MARK
#include "kdtree/merge.glsl"

// Whether a sorted pair is not the one before.
bool is_new(uint i) {
    KdMerge merge = merge_state();
    Words keys = Words(merge.sorted_keys);
    uint words = merge.key_words, before = max(i, 1u) - 1u;
    return i == 0u || keys.word[words * i] != keys.word[words * before]
        || keys.word[words * i + words - 1u] != keys.word[words * before + words - 1u];
}

// Whether a pair is the first of its leaf.
bool is_first(uint i) {
    return i == 0u || id_of_key(i) != id_of_key(i - 1u);
}

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

// Of the sums over marked leaves, as tasks of the first level: their references, those of the static tree among them, and how many
// are empty, the root apart.
uint all_references(Sums sums) {
    return sums.split_references;
}

uint own_references(Sums sums) {
    return sums.leaf_references;
}

uint empty_ones(Sums sums) {
    return sums.leaves;
}

// What is known of the leaves of a tile. Where their references and their pairs of nodes begin is counted in the tile.
void describe_tile(uint tile, uint marked) {
    KdMerge merge = merge_state();
    KdMarkedLeaves leaves = marked_leaves();
    KdStructure structure = KdStructure(structure_address);
    Sums sums = no_sums(), own = no_sums();
    uint pairs = pair_count(), end = min(tile * TILE + TILE, marked);
    // References of leaves, and leaves that are empty.
    uvec2 all = uvec2(0);
    for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        bool is_there = i < end;
        KdMarked leaf;
        leaf.id = leaves.leaf[min(i, end - 1u)].id;
        leaf.first = leaves.leaf[min(i, end - 1u)].first;
        uint next = i + 1u < marked ? leaves.leaf[i + 1u].first : pairs;
        KdPair pair = KdPairs(merge.pairs).pair[Words(merge.unique_values).word[leaf.first]];
        leaf.node = pair.node;
        KdNode node = kd_leaf(0u, 0u);
        if (leaf.node != NONE) node = structure.nodes[leaf.node];
        bool is_empty = leaf.node == NONE && leaf.id != ROOT_ID;
        leaf.own = node.first;
        leaf.from = node.second >> 2;
        leaf.count = leaf.own + next - leaf.first;
        leaf.home = is_empty ? leaf.id - 1u >> 1 : leaf.node;
        leaf.copies = 1u;
        uvec2 before = add_all(all, is_there ? uvec2(leaf.count, is_empty ? 1u : 0u) : uvec2(0));
        leaf.begin = before.x;
        leaf.pair = 2u * before.y;
        if (is_there) {
            own.leaf_references += leaf.own;
            add_task(own, leaf.count, pair.depth);
            // But for its number and its first pair, which the leaf before reads.
            leaves.leaf[i].node = leaf.node;
            leaves.leaf[i].count = leaf.count;
            leaves.leaf[i].own = leaf.own;
            leaves.leaf[i].from = leaf.from;
            leaves.leaf[i].begin = leaf.begin;
            leaves.leaf[i].home = leaf.home;
            leaves.leaf[i].pair = leaf.pair;
            leaves.leaf[i].copies = leaf.copies;
        }
    }
    add_all_tasks(sums, own);
    add_all(sums.leaf_references, own.leaf_references);
    sums.split_references = all.x;
    sums.leaves = all.y;
    if (gl_LocalInvocationIndex == 0u) task_tiles().tile[tile] = sums;
}

// All leaves are described: whether there is room for what they need, and what the build begins with. By one workgroup.
void begin_merged(uint marked) {
    KdState state = build_state();
    KdMerge merge = merge_state();
    KdStructure structure = KdStructure(structure_address);
    Sums sums = scan_tiles(tiles_of(marked));
    if (gl_LocalInvocationIndex != 0u) return;
    uint references = all_references(sums), empty = empty_ones(sums), wanted_marked = merge.wanted_marked;
    bool fits = merge.status == 0u && merge.wanted_pairs <= merge.pair_capacity && wanted_marked <= merge.marked_capacity
        && references <= reference_capacity && state.leaf_count + references <= cut_room
        && state.node_count + 2u * empty + marked <= level_node_room && marked <= task_capacity && marked <= subtree_capacity;
    uint base_node = state.node_count + (fits ? 2u * empty : 0u);
    if (!fits) {
        merge.status |= STATUS_OUT_OF_ROOM;
        state.status |= STATUS_OUT_OF_ROOM;
        state.active_count = 0u;
        marked = 0u;
    }
    Box cell = merged_cell();
    state.cell_lo = cell.lo;
    state.cell_hi = cell.hi;
    state.area_scale = state.active_count > 0u ? area_scale_of(cell) : structure.header.area_scale;
    state.node_count = base_node;
    state.most_references = references;
    state.most_cut = state.leaf_count + references;
    state.most_nodes = base_node + wanted_marked + (fits ? 0u : 2u * empty);
    state.most_subtrees = wanted_marked;
    merge.wanted_references = references;
    merge.marked_count = marked;
    merge.marked_empty = fits ? empty : 0u;
    merge.marked_root = marked > 0u && structure.header.node_count == 0u ? 1u : 0u;
    merge.replaced_references = fits ? own_references(sums) : 0u;
    merge.first_root = base_node;
    KdUndo(merge.undo).count = marked;
    PoolState pool = PoolState(state_address);
    pool_reset(pool, MERGE_PHASES);
    pool.tasks[PHASE_GATHER] = marked;
    pool.tasks[PHASE_HOOK] = tiles_of(marked);
    if (!fits) sums = no_sums();
    publish_level(0u, sums, fits ? references : 0u);
}

// The sibling of an empty leaf moves beside it. If it is a marked leaf, or the parent of one that is empty, that one writes it there.
void move_sibling(uint i, uint id, uint pair, uint marked) {
    KdMarkedLeaves leaves = marked_leaves();
    KdStructure structure = KdStructure(structure_address);
    uint parent = id - 1u >> 1, side = id - 1u & 1u;
    uint sibling = structure.nodes[parent].second >> 4;
    KdNode node = structure.nodes[sibling];
    uint writer = NONE;
    if (kd_is_leaf(node)) writer = find_marked(id_of(parent, 1u - side), marked);
    else if ((node.second & 12u) != 0u) writer = find_marked(id_of(sibling, (node.second & 4u) != 0u ? 0u : 1u), marked);
    if (writer != NONE) {
        leaves.leaf[writer].home = pair + 1u - side;
        leaves.leaf[i].copies = 0u;
    }
}

// The tasks of a tile of leaves, and where these begin in all. `home` of a leaf is its sibling's to write.
void write_marked_tile(uint tile) {
    KdMerge merge = merge_state();
    KdMarkedLeaves leaves = marked_leaves();
    Sums sums = task_tiles().tile[tile];
    uint marked = merge.marked_count, end = min(tile * TILE + TILE, marked);
    uint first_reference = all_references(sums);
    uint first_pair = KdStructure(structure_address).header.node_count + 2u * empty_ones(sums);
    for (uint base = tile * TILE; base < end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex, at = min(i, end - 1u);
        KdPair pair = KdPairs(merge.pairs).pair[Words(merge.unique_values).word[leaves.leaf[at].first]];
        Box cell = Box(pair.lo, pair.hi);
        KdTask none = new_task(cell, 0u, 0u, 0u), task = none;
        if (i < end) {
            uint id = leaves.leaf[i].id, first = first_reference + leaves.leaf[i].begin, own_pair = first_pair + leaves.leaf[i].pair;
            leaves.leaf[i].begin = first;
            leaves.leaf[i].pair = own_pair;
            if (leaves.leaf[i].node == NONE && id != ROOT_ID) move_sibling(i, id, own_pair, marked);
            task = new_task(cell, first, leaves.leaf[i].count, pair.depth);
        }
        write_tasks(0u, task, none, sums);
    }
}
#endif
