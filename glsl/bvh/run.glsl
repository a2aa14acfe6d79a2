// Climbing the radix tree from a run of positions (Apetrei 2014): of two siblings the second to arrive goes on with their parent.
// An invocation that has a run of positions meets most siblings itself and asks the others only at the run's two ends: atomics and
// their fences were a third of the time.
//
// On a GPU runs are short, and a fence for the device costs hundreds of cycles. There a task has two turns. In the first,
// invocations meet in shared memory, as far as the workgroup's positions go, with fences for the workgroup alone. In the second
// those subtrees go on whose siblings reach beyond it, a few for each level: they meet those of other workgroups.
//
// Where children get an order on the way (RULE, of bvh/child_weights.glsl), subtrees have weights beside their costs.
#ifndef HEDGEROW_BVH_RUN
#define HEDGEROW_BVH_RUN
#include "bvh/build_state.glsl"
#include "bvh/radix_tree.glsl"
#include "bvh/child_weights.glsl"

// A finished subtree over the positions first..=last, and the bits of the splits before and behind it.
struct Subtree {
    uint first;
    uint last;
    uint before;
    uint behind;
    Child child;
    float cost;
    Weight weight;
    float area;    // of its primitives
};

// What a node's children are weighed by, beside their costs.
struct ChildWeight {
    Weight weight;
    float area;
};

BUFFER ChildWeights { ChildWeight of[]; };

// Children of nodes by number: where lanes take a left and a right one, a load or store of either side does for both.
layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer Children { Child child[]; };

// A header is as long as so many children.
const uint HEADER_CHILDREN = 4;

uint child_number(uint slot, bool is_left) {
    return HEADER_CHILDREN + 2u * slot + (is_left ? 0u : 1u);
}

// The sibling of a subtree that has stepped up.
struct Sibling {
    Child child;
    float cost;
    Weight weight;
    float area;
};

const bool MEETS_IN_GROUP = ITEMS_WORD >> 16 != 0u;
const uint TURNS = MEETS_IN_GROUP ? 2u : 1u;

// A run from a position on, or NONE once its leaves are done; how many left children wait in it.
struct Run {
    Structure structure;
    Children children;    // of all nodes: `child_number`
    Words codes;
    Words ends;
    Floats left_costs;
    Floats right_costs;
    ChildWeights left_weights;     // behind the costs
    ChildWeights right_weights;
    uint active_count;
    uint first;
    uint waiting;
    uint end;           // behind what has begun last
    uint behind;        // the split there
    uvec2 code;         // of the position there
    uint group_first;   // the task's first position
    bool in_group;      // meets those of the workgroup
};

// Left children that wait for a sibling out of the same run of positions: where each begins (`packed_begin`). They lie side by side and
// end with the run so far, so that the last of them is the sibling of whichever right child comes next.
shared uint run_begins[ITEMS * gl_WorkGroupSize.x];

// For each split from the one before the task's positions to the one behind them, the far end of the child that came first, with
// its side; or that both came.
const uint GROUP_SPLITS = MEETS_IN_GROUP ? ITEMS * gl_WorkGroupSize.x + 1u : 1u;
const uint LEFT_SIDE = 1u << 31;
const uint BOTH_CAME = 0x7FFFFFFFu;
shared uint group_ends[GROUP_SPLITS];

uint run_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

uint run_base(Run run) {
    return run.group_first + gl_LocalInvocationIndex * ITEMS;
}

// Where in the run a subtree begins, and the bit of the split before it.
uint packed_begin(Run run, uint first, uint before) {
    return first - run_base(run) << SPLIT_BITS | before;
}

uint position_of(Run run, uint begin) {
    return run_base(run) + (begin >> SPLIT_BITS);
}

uint split_of(uint begin) {
    return begin & (1u << SPLIT_BITS) - 1u;
}

Run run_of(uint task) {
    Run run;
    run.structure = Structure(structure_address);
    run.children = Children(structure_address);
    run.codes = sorted_keys();
    run.ends = Words(part(parts.ends));
    run.left_costs = Floats(part(parts.child_costs[0]));
    run.right_costs = Floats(part(parts.child_costs[1]));
    run.left_weights = ChildWeights(address_of(uvec2(run.left_costs), primitive_count, 4u));
    run.right_weights = ChildWeights(address_of(uvec2(run.right_costs), primitive_count, 4u));
    run.active_count = build_state().active_count;
    run.group_first = task * gl_WorkGroupSize.x * ITEMS;
    run.first = run_base(run);
    run.waiting = 0u;
    run.end = run.first;
    run.behind = NO_SPLIT;
    run.code = uvec2(0u);
    if (run.first < run.active_count) {
        run.behind = split_before(run.codes, run.first);
        run.code = code_at(run.codes, run.first);
    }
    run.in_group = false;
    return run;
}

// By the workgroup together. In the second turn no invocation has a run.
void begin_turn(inout Run run, uint turn) {
    if (!MEETS_IN_GROUP) return;
    run.in_group = turn == 0u;
    if (turn == 0u) {
        for (uint i = gl_LocalInvocationIndex; i < GROUP_SPLITS; i += gl_WorkGroupSize.x) group_ends[i] = NONE;
        barrier();
    } else {
        run.first = NONE;
    }
}

// By the workgroup together: what was written in the turn, the next reads.
void end_turn() {
    if (MEETS_IN_GROUP) next_phase();
}

Floats costs_of(Run run, bool is_left) {
    return Floats(is_left ? uvec2(run.left_costs) : uvec2(run.right_costs));
}

ChildWeights weights_of(Run run, bool is_left) {
    return ChildWeights(is_left ? uvec2(run.left_weights) : uvec2(run.right_weights));
}

void load_weight(Run run, bool is_left, uint parent, out Weight weight, out float area) {
    weight = Weight(0.0, 0.0);
    area = 0.0;
    if (!HAS_WEIGHTS) return;
    ChildWeight of_child = weights_of(run, is_left).of[parent];
    weight = of_child.weight;
    area = of_child.area;
}

// The next subtree, from this split on, whose sibling has not come in the workgroup.
bool take_left_over(Run run, inout uint split, out Subtree s) {
    for (; split < GROUP_SPLITS; split += gl_WorkGroupSize.x) {
        uint end = group_ends[split];
        if (end == NONE || end == BOTH_CAME) continue;
        uint parent = run.group_first + split - 1u;
        bool is_left = (end & LEFT_SIDE) != 0u;
        s.first = is_left ? end & ~LEFT_SIDE : parent + 1u;
        s.last = is_left ? parent : end;
        s.child = run.children.child[child_number(parent, is_left)];
        s.cost = costs_of(run, is_left).value[parent];
        load_weight(run, is_left, parent, s.weight, s.area);
        s.before = split_before(run.codes, s.first);
        s.behind = split_behind(run.codes, s.last, run.active_count);
        split += gl_WorkGroupSize.x;
        return true;
    }
    return false;
}

// The positions of the next leaf of the run. What is behind one leaf is before the next: each code is loaded once.
void begin_leaf(inout Run run, inout Subtree s) {
    s.first = run.end;
    s.last = run.end++;
    s.before = run.behind;
    s.behind = NO_SPLIT;
    if (run.end < run.active_count) {
        uvec2 next = code_at(run.codes, run.end);
        s.behind = highest_bit(run.code, next, s.last, run.end);
        run.code = next;
    }
    run.behind = s.behind;
}

// The last of those that wait, once the leaves are done: its sibling begins behind the run.
Subtree take_waiting(inout Run run) {
    Subtree s;
    // What was taken last began where this ends.
    uint behind = run.first == NONE ? run_begins[run_slot(run.waiting)] : packed_begin(run, run.end, run.behind);
    uint begin = run_begins[run_slot(--run.waiting)];
    s.first = position_of(run, begin);
    s.last = position_of(run, behind) - 1u;
    s.before = split_of(begin);
    s.behind = split_of(behind);
    s.child = run.structure.nodes[s.last].left;
    s.cost = run.left_costs.value[s.last];
    load_weight(run, true, s.last, s.weight, s.area);
    run.first = NONE;
    return s;
}

// The node that splits between positions i and i + 1 has slot i, so the parent follows from which of the two neighbouring splits
// differs in a lower bit.
bool is_left_child(Subtree s) {
    return s.behind < s.before;
}

uint parent_of(Subtree s, bool is_left) {
    return is_left ? s.last : s.first - 1u;
}

// Tells where a child ends; returns where its sibling does, or NONE if that has not come yet.
uint meet_in_group(Run run, uint parent, bool is_left, uint end) {
    uint split = parent + 1u - run.group_first;
    memoryBarrier(gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsRelease | gl_SemanticsMakeAvailable);
    uint other = atomicExchange(group_ends[split], is_left ? end | LEFT_SIDE : end);
    if (other == NONE) return NONE;
    memoryBarrier(gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsAcquire | gl_SemanticsMakeVisible);
    atomicExchange(group_ends[split], BOTH_CAME);
    return other & ~LEFT_SIDE;
}

uint meet_in_device(Run run, uint parent, uint end) {
    release_to_device();
    uint other = atomicExchange(run.ends.word[parent], end);
    if (other != NONE) acquire_from_device();
    return other;
}

// Whether the sibling is the last that waits in the run: then no other invocation asks for the child.
bool meets_in_run(Run run, bool is_left) {
    return !is_left && run.waiting > 0u;
}

// Whether the sibling is there; then `s` has the positions and the box of both. Where children get an order and met in the run, the right
// one is not written yet, as it may belong on the left.
bool step_up(inout Run run, bool is_left, uint parent, inout Subtree s, out Sibling sibling) {
    bool in_run = meets_in_run(run, is_left);
    if (RULE == AS_BUILT || !in_run) run.children.child[child_number(parent, is_left)] = s.child;
    if (!in_run) {
        costs_of(run, is_left).value[parent] = s.cost;
        if (HAS_WEIGHTS) weights_of(run, is_left).of[parent] = ChildWeight(s.weight, s.area);
    }
    uint end = NONE, split = NO_SPLIT;
    if (is_left && s.first >= run.first) {
        run_begins[run_slot(run.waiting++)] = packed_begin(run, s.first, s.before);
    } else if (in_run) {
        uint begin = run_begins[run_slot(--run.waiting)];
        end = position_of(run, begin);
        split = split_of(begin);
    } else {
        uint own_end = is_left ? s.first : s.last;
        if (MEETS_IN_GROUP && run.in_group) end = meet_in_group(run, parent, is_left, own_end);
        else end = meet_in_device(run, parent, own_end);
        bool has_neighbour = end != NONE && (is_left ? end + 1u < run.active_count : end > 0u);
        uint at = is_left ? end : end - 1u;
        if (has_neighbour) split = bit_between(run.codes, at, at + 1u);
    }
    if (end != NONE) {
        s.last = is_left ? end : s.last;
        s.first = is_left ? s.first : end;
        s.before = is_left ? s.before : split;
        s.behind = is_left ? split : s.behind;
        sibling.child = run.children.child[child_number(parent, !is_left)];
        sibling.cost = costs_of(run, !is_left).value[parent];
        load_weight(run, !is_left, parent, sibling.weight, sibling.area);
        s.child.lo = min(s.child.lo, sibling.child.lo);
        s.child.hi = max(s.child.hi, sibling.child.hi);
    }
    return end != NONE;
}
#endif
