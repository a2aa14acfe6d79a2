// Objects' trees on their way down the static one (Papay 2025, section 10.3). See kdtree/merge.glsl.
//
// A node of an object's tree goes down the static tree while it is on one side of the planes. At a plane that it is on both sides of,
// and in a leaf, it falls into its children; a leaf of it goes to both sides. Leaves in leaves wait until all are there. Every step
// goes down in one of the trees, so there are as many as both are deep together, and one.
#ifndef HEDGEROW_KDTREE_MERGE_PUSH
#define HEDGEROW_KDTREE_MERGE_PUSH
#include "kdtree/merge.glsl"

// How near to a cell of an object's tree a static cell must be for triangles that are referenced in the one to be in the other.
//
// A triangle is in a static cell that is no farther from one of its points than its room, `room_of`, and three times `rounding_of`:
// faces are moved out by both, and corners that cuts make are off by less than the rounding, each time. The point is in a cell of the
// object's tree that references the triangle (src/kdtree/host/clip.rs). The room is two of the rounding's parts of the longest side
// and one rounding, so that is at most six of these parts and four of the others, of the greatest of all objects; eight are more,
// however that is rounded. Edges that are too long to be cut stay whole: then all is near.
vec3 nearness() {
    KdState state = build_state();
    Box around = Box(from_ordered(uvec3(state.lo[0], state.lo[1], state.lo[2])),
                     from_ordered(uvec3(state.hi[0], state.hi[1], state.hi[2])));
    float longest = uintBitsToFloat(state.longest);
    return longest < 1e36 ? 8.0 * rounding_of(around, longest) : uintBitsToFloat(uvec3(0x7F800000u));
}

bool is_in(Box b, Box cell) {
    return all(lessThanEqual(b.lo, cell.hi)) && all(greaterThanEqual(b.hi, cell.lo));
}

KdItem first_item(uint i) {
    KdSeed seed = KdSeeds(merge_state().seeds).seed[i];
    KdHeader header = KdStructure(seed.tree).header;
    return KdItem(root_place(), seed.tree, first_record_of(seed.first_tile), header.node_count > 0u ? 0u : NONE,
                  Box(header.lo, header.hi));
}

// The number of items that there was room for.
uint items_there(uint wanted) {
    return min(wanted, merge_state().item_capacity);
}

// Tiles of a step that has at least this many items.
void plan_items(uint of_step, uint count) {
    PoolState pool = PoolState(state_address);
    atomicMax(pool.tasks[of_step], (items_there(count) + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x);
}

// What a step wanted, reported by one invocation.
void note_items(uint wanted, uint of_step) {
    KdMerge merge = merge_state();
    merge.wanted_items = max(merge.wanted_items, wanted);
    if (wanted > merge.item_capacity) {
        if (merge.items_ended == 0u) merge.items_ended = of_step;
        merge.status |= STATUS_OUT_OF_ROOM;
    }
}

// Items of the next step, and how many tiles that has by now.
void add_items(KdItem left, KdItem right, bvec2 is_there, uint next) {
    KdMerge merge = merge_state();
    KdItems items = items_of(next);
    uint count = (is_there.x ? 1u : 0u) + (is_there.y ? 1u : 0u);
    uint before = subgroupExclusiveAdd(count), total = subgroupAdd(count), at = 0;
    if (total > 0u && subgroupElect()) {
        at = atomicAdd(merge.item_count[next % 3u], total);
        plan_items(next, at + total);
    }
    at = subgroupBroadcastFirst(at) + before;
    if (is_there.x && at < merge.item_capacity) items.item[at] = left;
    at += is_there.x ? 1u : 0u;
    if (is_there.y && at < merge.item_capacity) items.item[at] = right;
}

void add_met(KdItem item, bool is_there) {
    KdMerge merge = merge_state();
    uint before = subgroupExclusiveAdd(is_there ? 1u : 0u), total = subgroupAdd(is_there ? 1u : 0u), at = 0;
    if (total > 0u && subgroupElect()) {
        at = atomicAdd(merge.met_count, total);
        plan_items(PUSH_STEPS, at + total);
    }
    at = subgroupBroadcastFirst(at) + before;
    if (is_there && at < merge.item_capacity) met_items().item[at] = item;
}

// Where the invocation has an item. All of a workgroup come here, and reach what adds together.
void push_item(bool is_item, KdItem item, vec3 margin, uint next) {
    KdNode still = kd_leaf(0u, 0u), moving = still;
    if (is_item) {
        still = node_of(item.place);
        moving = KdStructure(item.tree).nodes[item.node];
    }
    bool is_in_leaf = kd_is_leaf(still), is_leaf = kd_is_leaf(moving);
    KdItem left = item, right = item;
    bvec2 is_there = bvec2(false);
    if (!is_in_leaf) {
        uint axis = still.second & 3u;
        float plane = uintBitsToFloat(still.first);
        Box near = widened(item.cell, margin);
        is_there = bvec2(near.lo[axis] <= plane, near.hi[axis] >= plane);
        places_below(item.place, still, left.place, right.place);
    }
    if (!is_leaf && (is_in_leaf || all(is_there))) {
        left = item;
        right = item;
        half_cells(item.cell, moving.second & 3u, uintBitsToFloat(moving.first), left.cell, right.cell);
        uvec2 children = children_of(moving);
        left.node = children.x;
        right.node = children.y;
        is_there = bvec2(left.node != NONE && is_in(widened(left.cell, margin), item.place.cell),
                         right.node != NONE && is_in(widened(right.cell, margin), item.place.cell));
    }
    add_items(left, right, is_there, next);
    add_met(item, is_item && is_in_leaf && is_leaf);
}

// The triangles of a leaf of an object's tree in a leaf of the static one, by the rule of merge_find.comp.
void meet_item(KdItem item, float reach, uint first_record) {
    KdStructure tree = KdStructure(item.tree);
    KdNode leaf = tree.nodes[item.node];
    Words references = Words(kd_references_at(item.tree, tree.header.node_room));
    uint i = 0;
    do {
        uint j = item.first_record + references.word[(leaf.second >> 2) + i];
        Box part;
        if (clip_triangle(corners_of_record(first_record + j), reach, item.place.cell, part)) add_pair(item.place, j);
    } while (++i < leaf.first);
}

// A tile of a step, an invocation an item. The counter of the step after the next is free by now.
void kd_push(uint tile, uint of_step) {
    KdMerge merge = merge_state();
    uint wanted = merge.item_count[of_step % 3u], i = tile * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i == 0u) {
        note_items(wanted, of_step);
        merge.item_count[(of_step + 2u) % 3u] = 0u;
    }
    bool is_item = i < (of_step == 0u ? merge.seed_count : items_there(wanted));
    KdItem item = KdItem(root_place(), uvec2(0), 0u, NONE, merged_cell());
    if (is_item && of_step == 0u) item = first_item(i);
    else if (is_item) item = items_of(of_step).item[i];
    push_item(is_item && item.node != NONE, item, nearness(), of_step + 1u);
}

// A tile of leaves in leaves, behind all steps.
void kd_meet(uint tile) {
    KdState state = build_state();
    uint wanted = merge_state().met_count, i = tile * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i == 0u) note_items(wanted, PUSH_STEPS);
    if (i < items_there(wanted)) meet_item(met_items().item[i], state.reach, state.first_record);
}
#endif
