// The LBVH's hierarchy: boxes, costs and collapsing bottom-up in one pass, a function over a task (a workgroup's worth of
// positions): dispatched by bvh/lbvh_hierarchy.comp or from the task pool by bvh/lbvh_persistent.comp. src/bvh/lbvh.rs records
// both.
//
//   hierarchy  reads the primitives, keys and values   writes the structure: records, nodes, root, costs
//
// needs one barrier before, behind bvh/encode.glsl's phases; subgroups of any size; workgroups of whole subgroups
#ifndef HEDGEROW_BVH_LBVH
#define HEDGEROW_BVH_LBVH
#include "bvh/encode.glsl"
#include "bvh/radix_tree.glsl"

// A finished subtree over the positions first..=last, and how the codes differ before and behind it.
struct Subtree {
    uint first;
    uint last;
    uvec3 before;
    uvec3 behind;
    Child child;
    float cost;
};

// Left children that wait for a sibling out of the same run of positions: where each begins. They lie side by side and end
// with the run so far, so that the last of them is the sibling of whichever right child comes next.
shared uint run_firsts[ITEMS * gl_WorkGroupSize.x];

uint run_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

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

// From a subtree up (Apetrei 2014): of two siblings the second to arrive goes on with their parent. The node that splits
// between positions i and i + 1 has slot i, so its parent follows from which of the two neighbouring splits differs in a lower
// bit. An invocation that has a run of positions meets most siblings itself and asks the others only at the run's two ends:
// atomics and their fences were a third of the time.
void climb(Structure structure, Words codes, uint active_count, float area_scale, uint run, inout uint waiting,
           inout uint unused, Subtree s) {
    Words ends = Words(ends_address);
    // The buffers that the sort has left free hold the costs of left and right children.
    uint is_free = 1 - (passes & 1);
    Floats left_costs = Floats(keys[is_free]);
    Floats right_costs = Floats(values[is_free]);
    // A level a differing bit: codes have 64 at most, positions 27.
    for (uint level = 0; level <= MAX_DEPTH; ++level) {
        if (s.first == 0 && s.last + 1 == active_count) {
            structure.header.root = s.child;
            structure.header.cost = s.cost;
            structure.header.built_cost = s.cost;
            break;
        }
        bool is_left = is_less(s.behind, s.before);
        uint parent = is_left ? s.last : s.first - 1;
        if (is_left) {
            structure.nodes[parent].left = s.child;
            left_costs.value[parent] = s.cost;
        } else {
            structure.nodes[parent].right = s.child;
            right_costs.value[parent] = s.cost;
        }
        uint end;
        if (is_left && s.first >= run) {
            run_firsts[run_slot(waiting)] = s.first;
            waiting++;
            break;
        }
        if (!is_left && waiting > 0) {
            waiting--;
            end = run_firsts[run_slot(waiting)];
        } else {
            release_to_device();
            end = atomicExchange(ends.word[parent], is_left ? s.first : s.last);
            if (end == NONE) break;
            acquire_from_device();
        }
        Child sibling;
        float sibling_cost;
        if (is_left) {
            s.last = end;
            s.behind = difference_behind(codes, s.last, active_count);
            sibling = structure.nodes[parent].right;
            sibling_cost = right_costs.value[parent];
        } else {
            s.first = end;
            s.before = difference_before(codes, s.first);
            sibling = structure.nodes[parent].left;
            sibling_cost = left_costs.value[parent];
        }
        s.child.lo = min(s.child.lo, sibling.lo);
        s.child.hi = max(s.child.hi, sibling.hi);
        uint count = s.last - s.first + 1;
        float area = scaled_half_area(Box(s.child.lo, s.child.hi), area_scale);
        float as_leaf = leaf_cost(c_i, area, count);
        s.cost = inner_cost(c_t, area, s.cost, sibling_cost);
        bool as_leaf_is_cheaper = collapses() && as_leaf < s.cost;
        s.child.index = as_leaf_is_cheaper ? s.first : parent;
        s.child.count = as_leaf_is_cheaper ? count : 0;
        if (as_leaf_is_cheaper) {
            s.cost = as_leaf;
            unused += free_slots(structure, s.first, s.last);
        }
    }
}

void lbvh_hierarchy(uint task) {
    BuildState state = BuildState(state_address);
    Structure structure = Structure(structure_address);
    uvec2 records = records_at(structure_address, max(primitive_count, 2) - 1);
    Geometry input_geometries = geometries();
    uint active_count = state.active_count;
    float area_scale = state.plan.area_scale;
    uint is_free = 1 - (passes & 1);
    Words codes = Words(keys[passes & 1]);
    Words order = Words(values[passes & 1]);
    uint run = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    uint end = min(run + ITEMS, primitive_count);
    uint position = run;
    uint waiting = 0;
    uint unused = 0;
    // First the leaves of the run; then what waits, last first: its siblings begin behind the run.
    bool leaves_done = false;
    while (true) {
        Subtree s;
        uint own_run = run;
        bool climbs = true;
        if (position < end) {
            Box b;
            write_reference(records, position, input_geometries, order.word[position], b);
            climbs = position < active_count;
            s.first = position;
            s.last = position;
            s.child = Child(b.lo, position, b.hi, 1);
            s.cost = leaf_cost(c_i, scaled_half_area(b, area_scale), 1);
            position++;
        } else if (waiting > 0) {
            own_run = NONE;
            // What was taken last began where this ends.
            s.last = (leaves_done ? run_firsts[run_slot(waiting)] : min(end, active_count)) - 1;
            leaves_done = true;
            waiting--;
            s.first = run_firsts[run_slot(waiting)];
            s.child = structure.nodes[s.last].left;
            s.cost = Floats(keys[is_free]).value[s.last];
        } else {
            break;
        }
        if (climbs) {
            s.before = difference_before(codes, s.first);
            s.behind = difference_behind(codes, s.last, active_count);
            climb(structure, codes, active_count, area_scale, own_run, waiting, unused, s);
        }
    }
    unused = subgroupAdd(unused);
    if (unused > 0 && subgroupElect()) atomicAdd(structure.header.inner_nodes, -unused);
}
#endif
