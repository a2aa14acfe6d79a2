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

// From a subtree up, as far as siblings are there.
void climb(inout Run run, float area_scale, Subtree s, inout uint unused) {
    Structure structure = run.structure;
    find_neighbours(run, s);
    // A level a differing bit: codes have 64 at most, positions 27.
    for (uint level = 0; level <= MAX_DEPTH; ++level) {
        if (s.first == 0 && s.last + 1 == run.active_count) {
            structure.header.root = s.child;
            structure.header.cost = s.cost;
            structure.header.built_cost = s.cost;
            break;
        }
        bool is_left = is_left_child(s);
        uint parent = parent_of(s, is_left);
        float sibling_cost;
        if (!step_up(run, is_left, parent, s, sibling_cost)) break;
        uint count = s.last - s.first + 1;
        float area = scaled_half_area(Box(s.child.lo, s.child.hi), area_scale);
        float as_leaf = leaf_cost(c_i, area, count);
        s.cost = inner_cost(c_t, area, s.cost, sibling_cost);
        bool as_leaf_is_cheaper = collapses != 0 && as_leaf < s.cost;
        s.child.index = as_leaf_is_cheaper ? s.first : parent;
        s.child.count = as_leaf_is_cheaper ? count : 0;
        if (as_leaf_is_cheaper) {
            s.cost = as_leaf;
            unused += free_slots(structure, s.first, s.last);
        }
    }
}

void lbvh_hierarchy(uint task) {
    uvec2 records = records_at(structure_address, max(primitive_count, 2) - 1);
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
                write_reference(records, position, input_geometries, order.word[position], b);
                climbs = position < run.active_count;
                s.first = position;
                s.last = position;
                s.child = Child(b.lo, position, b.hi, 1);
                s.cost = leaf_cost(c_i, scaled_half_area(b, area_scale), 1);
                position++;
            } else if (run.waiting > 0) {
                s = take_waiting(run, min(end, run.active_count));
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
