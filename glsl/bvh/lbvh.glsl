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

// Marks the slots below a leaf over the positions first..=last; how many had a node of the tree.
uint free_slots(Structure structure, uint first, uint last) {
    uint freed = 0;
    for (uint slot = first; slot < last; ++slot) {
        if (structure.nodes[slot].left.count != UNUSED) {
            structure.nodes[slot].left.count = UNUSED;
            freed += 1;
        }
    }
    return freed;
}

// The weight of the node over a subtree and its sibling, with this half area, and whether its children swap places.
Weight weight_of_node(bool is_left, float area, Subtree own, Sibling sibling, float area_scale, out bool swaps) {
    float own_area = scaled_half_area(Box(own.child.lo, own.child.hi), area_scale);
    float other_area = scaled_half_area(Box(sibling.child.lo, sibling.child.hi), area_scale);
    Weights2 w = is_left ? Weights2(own.weight, sibling.weight) : Weights2(sibling.weight, own.weight);
    vec2 areas = is_left ? vec2(own_area, other_area) : vec2(other_area, own_area);
    return weight_in_order(w, w, areas, area, c_t, swaps);
}

// Children are where they shall stay: one that is not written yet, or both of those that swap. No other invocation looks at the node any
// more.
void place_children(Run run, uint slot, bool is_left, bool is_written, bool swaps, Child own, Child sibling) {
    bool is_first = is_left != swaps;
    if (swaps || !is_written) run.children.child[child_number(slot, is_first)] = own;
    if (swaps) run.children.child[child_number(slot, !is_first)] = sibling;
}

// The area by which a ray meets a primitive with this half area of its box; of a triangle that was split what the box has room for.
float area_of_primitive(Corners c, float box_area, float area_scale) {
    if (!HAS_AREAS || kind_of_records() != KIND_TRIANGLES) return box_area;
    return min(area_of_triangle(c.v0, c.v1, c.v2, area_scale), box_area);
}

// From a subtree up, as far as siblings are there.
void climb(inout Run run, float area_scale, Subtree s, inout uint unused) {
    Structure structure = run.structure;
    // A level a differing bit: codes have 64 at most, positions 27.
    for (uint level = 0; level <= MAX_DEPTH; ++level) {
        if (s.first == 0 && s.last + 1 == run.active_count) {
            structure.header.root = s.child;
            structure.header.cost = s.cost;
            structure.header.built_cost = s.cost;
            if (RULE != AS_BUILT && s.child.count == 0u) structure.header.child_order = 1u;
            break;
        }
        bool is_left = is_left_child(s);
        uint parent = parent_of(s, is_left);
        bool is_written = RULE == AS_BUILT || !meets_in_run(run, is_left);
        Subtree own = s;
        Sibling sibling;
        if (!step_up(run, is_left, parent, s, sibling)) break;
        uint count = s.last - s.first + 1;
        float area = scaled_half_area(Box(s.child.lo, s.child.hi), area_scale);
        float as_leaf = leaf_cost(c_i, area, count);
        s.cost = inner_cost(c_t, area, s.cost, sibling.cost);
        bool as_leaf_is_cheaper = collapses != 0 && as_leaf < s.cost;
        s.child.index = as_leaf_is_cheaper ? s.first : parent;
        s.child.count = as_leaf_is_cheaper ? count : 0;
        if (HAS_AREAS) {
            precise float area_of_both = own.area + sibling.area;
            s.area = area_of_both;
        }
        if (RULE != AS_BUILT) {
            bool swaps = false;
            if (as_leaf_is_cheaper) s.weight = weight_of_leaf(s.area, area, count, c_i);
            else s.weight = weight_of_node(is_left, area, own, sibling, area_scale, swaps);
            place_children(run, parent, is_left, is_written, swaps, own.child, sibling.child);
        }
        if (as_leaf_is_cheaper) {
            s.cost = as_leaf;
            unused += free_slots(structure, s.first, s.last);
        }
    }
}

void lbvh_hierarchy(uint task) {
    uvec2 records = records_of_tree();
    Geometry input_geometries = geometries();
    float area_scale = build_state().plan.area_scale;
    Words order = sorted_values();
    Run run = run_of(task);
    uint position = run.first;
    uint end = min(position + ITEMS, primitive_count);
    uint unused = 0;
    for (uint turn = 0; turn < TURNS; ++turn) {
        begin_turn(run, turn);
        uint split = gl_LocalInvocationIndex;
        // First the leaves of the run; then what waits, last first; in the second turn what is left over.
        while (true) {
            Subtree s;
            bool climbs = true;
            if (position < end) {
                Box b;
                Corners c;
                write_reference(records, position, input_geometries, order.word[position], b, c);
                climbs = position < run.active_count;
                if (climbs) begin_leaf(run, s);
                s.child = Child(b.lo, position, b.hi, 1);
                float area = scaled_half_area(b, area_scale);
                s.cost = leaf_cost(c_i, area, 1);
                if (RULE != AS_BUILT && climbs) {
                    s.area = area_of_primitive(c, area, area_scale);
                    s.weight = weight_of_leaf(s.area, area, 1u, c_i);
                }
                position++;
            } else if (run.waiting > 0) {
                s = take_waiting(run);
            } else if (!MEETS_IN_GROUP || turn == 0 || !take_left_over(run, split, s)) {
                break;
            }
            if (climbs) climb(run, area_scale, s, unused);
        }
        end_turn();
    }
    unused = subgroupAdd(unused);
    if (unused > 0 && subgroupElect()) atomicAdd(run.structure.header.inner_nodes, -unused);
}
#endif
