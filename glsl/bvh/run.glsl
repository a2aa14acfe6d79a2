// Climbing the radix tree from a run of positions (Apetrei 2014): of two siblings the second to arrive goes on with their parent.
// An invocation that has a run of positions meets most siblings itself and asks the others only at the run's two ends: atomics and
// their fences were a third of the time.
#ifndef HEDGEROW_BVH_RUN
#define HEDGEROW_BVH_RUN
#include "bvh/build_state.glsl"
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

// A run from a position on, or NONE once its leaves are done; how many left children wait in it.
struct Run {
    Structure structure;
    Words codes;
    Words ends;
    // The buffers that the sort has left free hold the costs of left and right children.
    Floats left_costs;
    Floats right_costs;
    uint active_count;
    uint first;
    uint waiting;
};

// Left children that wait for a sibling out of the same run of positions: where each begins. They lie side by side and end
// with the run so far, so that the last of them is the sibling of whichever right child comes next.
shared uint run_firsts[ITEMS * gl_WorkGroupSize.x];

uint run_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

Run run_of(uint task) {
    uint sorted = passes & 1u;
    uint is_free = 1u - sorted;
    Run run;
    run.structure = Structure(structure_address);
    run.codes = Words(keys[sorted]);
    run.ends = Words(ends_address);
    run.left_costs = Floats(keys[is_free]);
    run.right_costs = Floats(values[is_free]);
    run.active_count = BuildState(state_address).active_count;
    run.first = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    run.waiting = 0u;
    return run;
}

// The last of those that wait, once the leaves up to `end` are done: its sibling begins behind the run.
Subtree take_waiting(inout Run run, uint end) {
    Subtree s;
    // What was taken last began where this ends.
    s.last = (run.first == NONE ? run_firsts[run_slot(run.waiting)] : end) - 1u;
    run.first = NONE;
    run.waiting--;
    s.first = run_firsts[run_slot(run.waiting)];
    s.child = run.structure.nodes[s.last].left;
    s.cost = run.left_costs.value[s.last];
    return s;
}

void find_neighbours(Run run, inout Subtree s) {
    s.before = difference_before(run.codes, s.first);
    s.behind = difference_behind(run.codes, s.last, run.active_count);
}

// The node that splits between positions i and i + 1 has slot i, so the parent follows from which of the two neighbouring splits
// differs in a lower bit.
bool is_left_child(Subtree s) {
    return is_less(s.behind, s.before);
}

uint parent_of(Subtree s, bool is_left) {
    return is_left ? s.last : s.first - 1u;
}

// Whether the sibling is there; then `s` has the positions and the box of both.
bool step_up(inout Run run, bool is_left, uint parent, inout Subtree s, out float sibling_cost) {
    if (is_left) {
        run.structure.nodes[parent].left = s.child;
        run.left_costs.value[parent] = s.cost;
    } else {
        run.structure.nodes[parent].right = s.child;
        run.right_costs.value[parent] = s.cost;
    }
    uint end = NONE;
    if (is_left && s.first >= run.first) {
        run_firsts[run_slot(run.waiting)] = s.first;
        run.waiting++;
    } else if (!is_left && run.waiting > 0u) {
        run.waiting--;
        end = run_firsts[run_slot(run.waiting)];
    } else {
        release_to_device();
        end = atomicExchange(run.ends.word[parent], is_left ? s.first : s.last);
        if (end != NONE) acquire_from_device();
    }
    if (end != NONE) {
        Child sibling;
        if (is_left) {
            s.last = end;
            s.behind = difference_behind(run.codes, s.last, run.active_count);
            sibling = run.structure.nodes[parent].right;
            sibling_cost = run.right_costs.value[parent];
        } else {
            s.first = end;
            s.before = difference_before(run.codes, s.first);
            sibling = run.structure.nodes[parent].left;
            sibling_cost = run.left_costs.value[parent];
        }
        s.child.lo = min(s.child.lo, sibling.lo);
        s.child.hi = max(s.child.hi, sibling.hi);
    }
    return end != NONE;
}
#endif
