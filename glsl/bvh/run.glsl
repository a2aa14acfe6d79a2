// Climbing the radix tree from a run of positions (Apetrei 2014): of two siblings the second to arrive goes on with their parent.
// An invocation writes the children that are leaves of its run; then it joins siblings that are both in the run, and asks other
// invocations only for those of the few subtrees that are left: atomics and their fences were a third of the time. What is joined
// is read from where its children were written, so that lanes keep nothing but positions, and all of them join in each turn:
// where each lane went from a leaf up as far as it could, all waited for the longest climb.
//
// On a GPU runs are short, and a fence for the device costs hundreds of cycles. There subtrees that are left meet in two turns. In
// the first, invocations meet in shared memory, as far as the workgroup's positions go, with fences for the workgroup alone. In the
// second those subtrees go on whose siblings reach beyond it, a few for each level: they meet those of other workgroups.
//
// Includers define what is made of two siblings, and where a climb ends: `place`, `join` and `ends_at`.
#ifndef HEDGEROW_BVH_RUN
#define HEDGEROW_BVH_RUN
#include "bvh/build_state.glsl"
#include "bvh/radix_tree.glsl"
#include "bvh/child_weights.glsl"

// A subtree over the positions first..=last, and the bits of the splits before and behind it.
struct Subtree {
    uint first;
    uint last;
    uint before;
    uint behind;
};

// What a node's children are weighed by, beside their costs.
struct ChildWeight {
    Weight weight;
    float area;    // of its primitives
};

const ChildWeight NO_WEIGHT = ChildWeight(Weight(0.0, 0.0), 0.0);

BUFFER ChildWeights { ChildWeight of[]; };

// A child of a node, with all that is known of it.
struct Weighed {
    Child child;
    float cost;
    ChildWeight weight;
};

// Children of nodes by number: where lanes take a left and a right one, a load or store of either side does for both.
layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer Children { Child child[]; };

// A header is as long as so many children.
const uint HEADER_CHILDREN = 4;

uint child_number(uint slot, bool is_left) {
    return HEADER_CHILDREN + 2u * slot + (is_left ? 0u : 1u);
}

const bool MEETS_IN_GROUP = ITEMS_WORD >> 16 != 0u;

// A run of positions, and how far its invocation is.
struct Run {
    Structure structure;
    Children children;    // of all nodes: `child_number`
    Words codes;
    Words ends;
    Floats left_costs;
    Floats right_costs;
    ChildWeights left_weights;     // behind the costs
    ChildWeights right_weights;
    float area_scale;
    uint active_count;
    uint group_first;   // the task's first position
    uint begin;
    uint end;           // behind the last that is active
    uint position;      // the next leaf
    uint before;        // the split before it
    uint waiting;       // words of `run_words`
    uint left_over;     // those of them that are for others, from the first on
    uint freed;         // nodes that are in leaves now
};

// In order, the subtrees of the run that wait: for siblings of the run, which begin behind the last, or from the first on for those of
// others, and those whose climb has ended. Together they are all positions so far. A word has where its subtree begins, and the bit of
// the split there. Until a leaf is taken, its word has the bit of the split behind it.
shared uint run_words[ITEMS * gl_WorkGroupSize.x];

// In a word: the subtree's climb has ended.
const uint HAS_ENDED = 1u << 31;

// For each split from the one before the task's positions to the one behind them, the far end of the child that came first, with
// its side; or that both came.
const uint GROUP_SPLITS = MEETS_IN_GROUP ? ITEMS * gl_WorkGroupSize.x + 1u : 1u;
const uint LEFT_SIDE = 1u << 31;
const uint BOTH_CAME = 0x7FFFFFFFu;
shared uint group_ends[GROUP_SPLITS];

// The node that splits between positions i and i + 1 has slot i, so the parent follows from which of the two neighbouring splits
// differs in a lower bit.
bool is_left_child(Subtree s) {
    return s.behind < s.before;
}

uint parent_of(Subtree s, bool is_left) {
    return is_left ? s.last : s.first - 1u;
}

// Writes what is known of a subtree where it belongs. Returns whether its climb ends there.
bool place(Run run, Subtree s, Weighed own);
// Makes the node at `slot` of its children, and writes it where it belongs. Returns whether the climb ends with it.
bool join(inout Run run, uint slot, Subtree s);
// Whether a subtree whose sibling is not in the run has none; then what is to be known of it is written.
bool ends_at(Run run, Subtree s);

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
    run.area_scale = build_state().plan.area_scale;
    run.active_count = build_state().active_count;
    run.group_first = task * gl_WorkGroupSize.x * ITEMS;
    run.begin = run.group_first + gl_LocalInvocationIndex * ITEMS;
    run.end = min(run.begin + ITEMS, run.active_count);
    run.position = run.begin;
    run.before = run.begin < run.end ? split_before(run.codes, run.begin) : NO_SPLIT;
    run.waiting = 0u;
    run.left_over = 0u;
    run.freed = 0u;
    return run;
}

Floats costs_of(Run run, bool is_left) {
    return Floats(is_left ? uvec2(run.left_costs) : uvec2(run.right_costs));
}

ChildWeights weights_of(Run run, bool is_left) {
    return ChildWeights(is_left ? uvec2(run.left_weights) : uvec2(run.right_weights));
}

void write_child(Run run, uint slot, bool is_left, Weighed w) {
    run.children.child[child_number(slot, is_left)] = w.child;
    costs_of(run, is_left).value[slot] = w.cost;
    if (HAS_WEIGHTS) weights_of(run, is_left).of[slot] = w.weight;
}

Weighed child_at(Run run, uint slot, bool is_left) {
    Weighed w;
    w.child = run.children.child[child_number(slot, is_left)];
    w.cost = costs_of(run, is_left).value[slot];
    w.weight = NO_WEIGHT;
    if (HAS_WEIGHTS) w.weight = weights_of(run, is_left).of[slot];
    return w;
}

// ---- the run ----

uint run_slot(uint place) {
    return place * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

uvec2 code_of_first(Run run) {
    return run.begin < run.end ? code_at(run.codes, run.begin) : uvec2(0u);
}

// Places a leaf. The split before it and its code are given, and become those of the next.
void place_leaf(Run run, uint position, Weighed own, inout uint before, inout uvec2 code) {
    uint behind = split_to_next(run.codes, position, run.active_count, code);
    bool has_ended = place(run, Subtree(position, position, before, behind), own);
    run_words[run_slot(position - run.begin)] = behind | (has_ended ? HAS_ENDED : 0u);
    before = behind;
}

// Puts a subtree behind those that wait, unless its sibling is the last of them. Returns whether it did.
bool put_off(inout Run run, Subtree s, bool has_ended) {
    bool is_left = is_left_child(s);
    bool joins = !is_left && !has_ended && run.waiting > run.left_over;
    if (!joins) {
        uint word = s.first - run.begin << SPLIT_BITS | s.before;
        run_words[run_slot(run.waiting++)] = word | (has_ended ? HAS_ENDED : 0u);
        // Before a right one nothing waits for a sibling of the run. What waits before one that has ended will have none: `ends_at` says so.
        if (has_ended || !is_left) run.left_over = run.waiting;
    }
    return !joins;
}

uint split_of(uint word) {
    return word & (1u << SPLIT_BITS) - 1u;
}

uint position_of(Run run, uint word) {
    return run.begin + ((word & ~HAS_ENDED) >> SPLIT_BITS);
}

// Joins all siblings that are both in the run.
void join_in_run(inout Run run) {
    Subtree s;
    bool joins = false;
    for (uint turn = 0; turn < ITEMS; ++turn) {
        // To the next leaf that is a right one.
        while (!joins && run.position < run.end) {
            uint word = run_words[run_slot(run.position - run.begin)];
            s = Subtree(run.position, run.position, run.before, split_of(word));
            run.position++;
            run.before = s.behind;
            joins = !put_off(run, s, (word & HAS_ENDED) != 0u);
        }
        if (!joins) break;
        uint word = run_words[run_slot(--run.waiting)];
        uint slot = s.first - 1u;
        s.first = position_of(run, word);
        s.before = split_of(word);
        bool has_ended = join(run, slot, s);
        joins = !put_off(run, s, has_ended);
    }
}

// ---- beyond the run ----

// The last of those that wait whose climb has not ended.
bool take_waiting(inout Run run, inout Subtree s) {
    while (run.waiting > 0u) {
        uint word = run_words[run_slot(--run.waiting)];
        s = Subtree(position_of(run, word), run.position - 1u, split_of(word), run.before);
        // What is taken next ends there.
        run.position = s.first;
        run.before = s.before;
        if ((word & HAS_ENDED) == 0u) return true;
    }
    return false;
}

// The next subtree, from this split on, whose sibling has not come in the workgroup.
bool take_left_over(Run run, inout uint split, inout Subtree s) {
    for (; split < GROUP_SPLITS; split += gl_WorkGroupSize.x) {
        uint end = group_ends[split];
        if (end == NONE || end == BOTH_CAME) continue;
        uint parent = run.group_first + split - 1u;
        bool is_left = (end & LEFT_SIDE) != 0u;
        s.first = is_left ? end & ~LEFT_SIDE : parent + 1u;
        s.last = is_left ? parent : end;
        s.before = split_before(run.codes, s.first);
        s.behind = split_behind(run.codes, s.last, run.active_count);
        split += gl_WorkGroupSize.x;
        return true;
    }
    return false;
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

// Whether the sibling is there; then `s` becomes both.
bool meets(Run run, bool in_group, bool is_left, uint parent, inout Subtree s) {
    uint own_end = is_left ? s.first : s.last;
    uint end = NONE;
    if (in_group) end = meet_in_group(run, parent, is_left, own_end);
    else end = meet_in_device(run, parent, own_end);
    if (end != NONE) {
        bool has_neighbour = is_left ? end + 1u < run.active_count : end > 0u;
        uint at = is_left ? end : end - 1u;
        uint split = NO_SPLIT;
        if (has_neighbour) split = bit_between(run.codes, at, at + 1u);
        s.last = is_left ? end : s.last;
        s.first = is_left ? s.first : end;
        s.before = is_left ? s.before : split;
        s.behind = is_left ? split : s.behind;
    }
    return end != NONE;
}

// A level a differing bit: codes have 64 at most, positions 27.
const uint MOST_LEVELS = 64 + 27;

// From each subtree that is left up, as far as siblings are there: by the workgroup together.
void join_beyond_run(inout Run run) {
    uint split = gl_LocalInvocationIndex;
    for (uint turn = MEETS_IN_GROUP ? 0u : 1u; turn < 2u; ++turn) {
        bool in_group = turn == 0u;
        if (in_group) {
            for (uint i = gl_LocalInvocationIndex; i < GROUP_SPLITS; i += gl_WorkGroupSize.x) group_ends[i] = NONE;
            barrier();
        }
        Subtree s;
        bool climbs = false;
        for (uint step = 0; step < (ITEMS + 1u) * (MOST_LEVELS + 1u); ++step) {
            if (!climbs && !take_waiting(run, s) && (!MEETS_IN_GROUP || in_group || !take_left_over(run, split, s))) break;
            climbs = !ends_at(run, s);
            if (climbs) {
                bool is_left = is_left_child(s);
                uint parent = parent_of(s, is_left);
                climbs = meets(run, in_group, is_left, parent, s) && !join(run, parent, s);
            }
        }
        // What was written in the turn, the next reads.
        if (MEETS_IN_GROUP) next_phase();
    }
}
#endif
