// The step `open` of bvh/wide_collapse.glsl: finds the children of a wide node, and lists those that are nodes.
#ifndef HEDGEROW_BVH_WIDE_OPEN
#define HEDGEROW_BVH_WIDE_OPEN
#include "bvh/wide_octants.glsl"
#include "bvh/wide_octants.glsl"

// What is known of the children so far, beside open_middle.
uint open_name[8];
uint open_index[8];
uint open_count[8];
uint open_depth[8];
// What speaks for opening it; less than 0 for a leaf.
float open_weight[8];

// The same as `weight` in src/bvh/wide/host.rs.
void put_child(uint at, uint name, uint depth, uint level, float scale) {
    Child child = child_named(name);
    open_name[at] = name;
    open_index[at] = child.index;
    open_count[at] = child.count;
    open_depth[at] = depth;
    float weight = level < LEVELS_BY_AREA ? scaled_half_area(Box(child.lo, child.hi), scale) : float(64 - depth);
    open_weight[at] = is_inner(child) ? weight : -1.0;
    if (QUANTISED) open_middle[at] = quarter_middle(child.lo, child.hi);
}

// The children of the wide node that begins with the binary node `slot`: how many.
uint open_children(uint slot, uint level, Child root) {
    if (!is_inner(root)) {
        put_child(0, WHOLE_TREE, 0, level, 0.0);
        return 1;
    }
    float scale = source.header.area_scale;
    put_child(0, 2 * slot, 1, level, scale);
    put_child(1, 2 * slot + 1, 1, level, scale);
    uint count = 2;
    while (count < WIDTH) {
        uint largest = 8;
        float weight = -1.0;
        for (uint i = 0; i < count; ++i) {
            if (open_weight[i] > weight) {
                weight = open_weight[i];
                largest = i;
            }
        }
        if (largest == 8) break;
        uint opens = open_index[largest], depth = open_depth[largest] + 1;
        put_child(largest, 2 * opens, depth, level, scale);
        put_child(count, 2 * opens + 1, depth, level, scale);
        count++;
    }
    return count;
}

// Of the binary node that a wide one begins with, whose box is that of the wide one.
vec3 middle_of_node(uint slot) {
    Child root = source.header.root;
    if (!is_inner(root)) return quarter_middle(root.lo, root.hi);
    Child left = child_named(2 * slot), right = child_named(2 * slot + 1);
    return quarter_middle(min(left.lo, right.lo), max(left.hi, right.hi));
}

// Lists the nodes of all lanes that are here together, in one piece.
uint place_in_next_level(uint level, uint nodes) {
    uint before = subgroupExclusiveAdd(nodes);
    uint all = subgroupAdd(nodes);
    uint first = 0;
    if (subgroupElect()) first = atomicAdd(levels.count[level + 1], all);
    return subgroupBroadcastFirst(first) + before;
}

// Opens the node at `at` of opened.
void open(uint at, uint level, uint next_level) {
    uint slot = opened.node[at].slot;
    uint count = open_children(slot, level, source.header.root);

    uint in_slot[8];
    for (uint s = 0; s < 8; ++s) in_slot[s] = s < count ? s : 8;
    if (QUANTISED) octant_slots(count, middle_of_node(slot), in_slot);

    uint nodes = 0, inner = 0, records = 0;
    for (uint s = 0; s < WIDTH; ++s) {
        uint i = in_slot[s];
        slots.word[at * WIDTH + s] = i < 8 ? open_name[i] : NO_CHILD;
        if (i == 8) continue;
        bool is_leaf = open_count[i] != 0;
        if (is_leaf) records += open_count[i];
        if (!is_leaf) inner++;
        if (!is_leaf || QUANTISED && open_count[i] > LEAF_MAX) nodes++;
    }
    first_children.word[slot] = nodes;
    if (QUANTISED) first_records.word[slot] = records;

    uint next = next_level + place_in_next_level(level, inner);
    uint rank = 0;
    for (uint s = 0; s < WIDTH; ++s) {
        uint i = in_slot[s];
        if (i == 8) continue;
        if (open_count[i] == 0 && next < capacity) opened.node[next++] = Opened(open_index[i], slot << 3 | rank);
        if (open_count[i] == 0 || QUANTISED && open_count[i] > LEAF_MAX) rank++;
    }
}
#endif
