// The LBVH's hierarchy: boxes, costs and collapsing bottom-up in one pass, a function over a task (a workgroup's worth of
// positions): dispatched by bvh/lbvh/hierarchy.comp or from the task pool by bvh/lbvh/persistent.comp. src/bvh/lbvh.rs records
// both.
//
//   hierarchy  reads the primitives, keys and values   writes the structure: records, nodes, root, costs
//
// needs one barrier before, behind bvh/encode.glsl's phases; subgroups of any size; workgroups of whole subgroups
#ifndef HEDGEROW_BVH_LBVH
#define HEDGEROW_BVH_LBVH
#include "bvh/encode.glsl"

// ChildOrder::rule in src/bvh/child_order.rs, or 0: children stay as the codes have them.
layout(constant_id = 7) const uint RULE = 0;
#include "bvh/run.glsl"

// Marks the slots first..end; how many had a node of the tree.
uint free_slots(Structure structure, uint first, uint end) {
    uint freed = 0;
    for (uint slot = first; slot < end; ++slot) {
        if (structure.nodes[slot].left.count != UNUSED) {
            structure.nodes[slot].left.count = UNUSED;
            freed += 1;
        }
    }
    return freed;
}

// Writes a subtree's child where it belongs; returns whether it is the root.
bool place(Run run, Subtree s, Weighed own) {
    bool is_root = s.first == 0u && s.last + 1u == run.active_count;
    if (is_root) {
        run.structure.header.root = own.child;
        run.structure.header.cost = own.cost;
        run.structure.header.built_cost = own.cost;
        if (RULE != AS_BUILT && own.child.count == 0u) run.structure.header.child_order = 1u;
    } else {
        bool is_left = is_left_child(s);
        write_child(run, parent_of(s, is_left), is_left, own);
    }
    return is_root;
}

// The weight of the node at `slot` of this half area, and its children in their order.
Weight order_children(Run run, uint slot, Weighed left, Weighed right, float area) {
    vec2 areas = vec2(scaled_half_area(Box(left.child.lo, left.child.hi), run.area_scale),
                      scaled_half_area(Box(right.child.lo, right.child.hi), run.area_scale));
    Weights2 weights = Weights2(left.weight.weight, right.weight.weight);
    bool swaps;
    Weight weight = weight_in_order(weights, weights, areas, area, c_t, swaps);
    if (swaps) {
        run.children.child[child_number(slot, true)] = right.child;
        run.children.child[child_number(slot, false)] = left.child;
    }
    return weight;
}

// Makes the node of a subtree, or a leaf if that is cheaper, of its two children at `slot`, and places it.
bool join(inout Run run, uint slot, Subtree s) {
    Weighed left = child_at(run, slot, true), right = child_at(run, slot, false);
    uint count = s.last - s.first + 1u;
    Box b = Box(min(left.child.lo, right.child.lo), max(left.child.hi, right.child.hi));
    float area = scaled_half_area(b, run.area_scale);
    float as_leaf = leaf_cost(c_i, area, count);
    float as_inner = inner_cost(c_t, area, left.cost, right.cost);
    bool is_leaf = collapses != 0u && as_leaf < as_inner;
    Weighed own;
    own.child = Child(b.lo, is_leaf ? s.first : slot, b.hi, is_leaf ? count : 0u);
    own.cost = is_leaf ? as_leaf : as_inner;
    own.weight = NO_WEIGHT;
    if (HAS_AREAS) {
        precise float area_of_both = left.weight.area + right.weight.area;
        own.weight.area = area_of_both;
    }
    if (RULE != AS_BUILT) {
        if (is_leaf) own.weight.weight = weight_of_leaf(own.weight.area, area, count, c_i);
        else own.weight.weight = order_children(run, slot, left, right, area);
    }
    // Below children that are leaves all is marked.
    uint first_node = left.child.count == 0u ? s.first : slot;
    uint end_of_nodes = right.child.count == 0u ? s.last : slot + 1u;
    if (is_leaf) run.freed += free_slots(run.structure, first_node, end_of_nodes);
    return place(run, s, own);
}

// Only the root has no parent.
bool ends_at(Run run, Subtree s) {
    return false;
}

// The area by which a ray meets a primitive with this half area of its box; of a triangle that was split what the box has room for.
float area_of_primitive(Corners c, float box_area, float area_scale) {
    if (!HAS_AREAS || kind_of_records() != KIND_TRIANGLES) return box_area;
    return min(area_of_triangle(c.v0, c.v1, c.v2, area_scale), box_area);
}

// The records of a run, and its leaves. Those behind all active primitives are in no leaf.
void write_leaves(Run run) {
    uvec2 records = records_of_tree();
    Geometry input_geometries = geometries();
    Words order = sorted_values();
    uvec2 code = code_of_first(run);
    uint before = run.before;
    uint end = min(run.begin + ITEMS, primitive_count);
    for (uint position = run.begin; position < end; ++position) {
        Box b;
        Corners c;
        write_reference(records, position, input_geometries, order.word[position], b, c);
        if (position < run.end) {
            float area = scaled_half_area(b, run.area_scale);
            Weighed own;
            own.child = Child(b.lo, position, b.hi, 1u);
            own.cost = leaf_cost(c_i, area, 1u);
            own.weight = NO_WEIGHT;
            if (RULE != AS_BUILT) {
                own.weight.area = area_of_primitive(c, area, run.area_scale);
                own.weight.weight = weight_of_leaf(own.weight.area, area, 1u, c_i);
            }
            place_leaf(run, position, own, before, code);
        }
    }
}

void lbvh_hierarchy(uint task) {
    Run run = run_of(task);
    write_leaves(run);
    join_in_run(run);
    join_beyond_run(run);
    uint freed = subgroupAdd(run.freed);
    if (freed > 0u && subgroupElect()) atomicAdd(run.structure.header.inner_nodes, -freed);
}
#endif
