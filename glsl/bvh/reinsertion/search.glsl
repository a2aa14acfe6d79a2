// The step `search` of bvh/reinsertion.glsl: the best move of each subtree, and its gain on all nodes of its path.
#ifndef HEDGEROW_BVH_REINSERTION_SEARCH
#define HEDGEROW_BVH_REINSERTION_SEARCH
#include "bvh/reinsertion.glsl"

// Subtrees that are put off; what does not find room is not looked at.
const uint STACK = 32;
// Nodes that a search looks into, at most. Few look into more, and those find little there: over six scenes trees cost the same within
// 0.1% (with 64 to five digits). Where some subtrees are far larger than others, rounds would take eight times as long without it.
const uint VISITS = 32;
// Of those, the first that lie in shared memory: a GPU has an invocation's own arrays far away.
layout(constant_id = 2) const uint SHARED_ENTRIES = 0;
// A gain counts if it is more than this share of the pivot's cost (less may be rounding) and more than this (less may be made of
// numbers that devices take for zero).
const float LEAST_SHARE = 1.0 / 1048576.0;
const float LEAST_GAIN = 1.0 / 1152921504606846976.0;

struct Search {
    Box moving;
    float moving_cost;
    float scale;
    float moving_by_rays;   // the part of its cost that is not its area
    float of_rays;
    uint pivot;
    float least;     // what a gain must exceed at this pivot
    uint visits;
    uint best_to;
    uint best_pivot;
    float best_gain;
};

// A node that may be looked into, and what would be saved if the move went below it.
struct Below {
    uint slot;
    float saved;
};

const uint SHARED_SIZE = SHARED_ENTRIES == 0 ? 1 : SHARED_ENTRIES * gl_WorkGroupSize.x;
shared Below put_off_first[SHARED_SIZE];
Below put_off[STACK];

void put(uint at, Below b) {
    if (at < SHARED_ENTRIES) put_off_first[at * gl_WorkGroupSize.x + gl_LocalInvocationIndex] = b;
    else put_off[at] = b;
}

Below take(uint at) {
    if (at < SHARED_ENTRIES) return put_off_first[at * gl_WorkGroupSize.x + gl_LocalInvocationIndex];
    return put_off[at];
}

float bar(Search s) {
    return max(s.best_gain, s.least);
}

// The new node has at least the cost of what moves.
bool may_gain(Search s, Below b) {
    precise float most = b.saved - s.moving_cost;
    return b.slot != NONE && most > bar(s);
}

// What would be saved below a child that a move has grown to this cost.
Below below(uint at, Child child, float saved, float merged, Search s) {
    precise float left = saved - (merged - cost_at(at, child, s.scale));
    return Below(child.count == 0u ? child.index : NONE, left);
}

// What a box by rays costs at least, around what moves and a child of this cost: to ask the grid takes many times as long.
float least_cost(Search s, Box merged, Child child, float cost) {
    precise float by_rays = cost - area_of(box_of(child), s.scale);
    precise float least = area_of(merged, s.scale) + max(by_rays, s.moving_by_rays);
    return least;
}

// What a move to link `at`, where `child` hangs, would gain.
Below look(inout Search s, uint at, Child child, float saved) {
    Box box = around(box_of(child), s.moving);
    if (BY_RAYS) {
        float own = costs.value[at];
        float least = least_cost(s, box, child, own);
        precise float most = saved - least;
        precise float most_below = saved - (least - own) - s.moving_cost;
        if (most <= bar(s) && (child.count != 0u || most_below <= bar(s))) return Below(NONE, 0.0);
    }
    float merged = cost_of(box, s.scale, s.of_rays);
    precise float gain = saved - merged;
    if (gain > bar(s)) {
        s.best_to = at;
        s.best_pivot = s.pivot;
        s.best_gain = gain;
    }
    return below(at, child, saved, merged, s);
}

// Into the subtree on the other side of the pivot.
void search_below(inout Search s, Below next) {
    uint height = 0;
    for (uint turn = 0; turn < link_count && s.visits < VISITS; ++turn) {
        if (may_gain(s, next)) {
            s.visits++;
            Node node = structure.nodes[next.slot];
            Below left = look(s, 2u * next.slot, node.left, next.saved);
            Below right = look(s, 2u * next.slot + 1u, node.right, next.saved);
            bool swap = right.saved > left.saved;
            Below far = left, near = right;
            if (!swap) {
                far = right;
                near = left;
            }
            if (may_gain(s, far) && height < STACK) put(height++, far);
            if (may_gain(s, near) && height < STACK) put(height++, near);
        }
        if (height == 0u) break;
        next = take(--height);
    }
}

// Whether the new place is no more than PATH nodes below the pivot.
bool is_path_walkable(uint to, uint pivot) {
    uint slot = to >> 1;
    for (uint level = 0; level < PATH; ++level) {
        if (slot == pivot) return true;
        slot = above(slot);
    }
    return false;
}

// Of a node, by rays.
float known_cost(uint slot, uint root) {
    return slot == root ? uintBitsToFloat(totals.word[TOTALS_ROOT]) : costs.value[parents.word[slot]];
}

Move search(uint link) {
    uint parent = link >> 1, root = structure.header.root.index;
    Move none = Move(NONE, NONE, 0u);
    if (!is_used(parent) || parent == root) return none;
    Search s;
    s.moving = box_of(child_at(link));
    s.scale = structure.header.area_scale;
    s.of_rays = ratio();
    s.moving_cost = cost_at(link, child_at(link), s.scale);
    precise float moving_by_rays = s.moving_cost - area_of(s.moving, s.scale);
    s.moving_by_rays = moving_by_rays;
    s.visits = 0;
    s.best_to = NONE;
    s.best_pivot = NONE;
    s.best_gain = 0.0;
    // What all nodes cost less, without a new one; so far, the parent's cost.
    precise float saved = 0.0;
    // What is left below the pivot on the side that the subtree leaves.
    Box left_behind;
    uint at = link;
    for (uint level = 0; level < PATH; ++level) {
        s.pivot = at >> 1;
        Node node = structure.nodes[s.pivot];
        Child other = (at & 1u) == 0u ? node.right : node.left;
        Box pivot_box = around(box_of(node.left), box_of(node.right));
        float pivot_cost = BY_RAYS ? known_cost(s.pivot, root) : area_of(pivot_box, s.scale);
        if (level == 0u) saved = pivot_cost;
        s.least = max(LEAST_SHARE * pivot_cost, LEAST_GAIN);
        // A move beside the own sibling would tie a cycle. It is never looked at: the box around both is the parent's.
        Below next;
        if (level == 0u) next = below(at ^ 1u, other, saved, pivot_cost, s);
        else next = look(s, at ^ 1u, other, saved);
        search_below(s, next);
        if (s.pivot == root) break;
        if (level == 0u) {
            left_behind = box_of(other);
        } else {
            left_behind = around(left_behind, box_of(other));
            // What is inside of a box, and does not touch its faces, leaves it as it is.
            if (!BY_RAYS || left_behind != pivot_box) saved = saved + (pivot_cost - cost_of(left_behind, s.scale, s.of_rays));
        }
        at = parents.word[s.pivot];
    }
    if (s.best_to == NONE || !is_path_walkable(s.best_to, s.best_pivot)) return none;
    return Move(s.best_to, s.best_pivot, floatBitsToUint(s.best_gain));
}

void search_moves() {
    if (AREAS != AREAS_WHOLE) clip = part.box;
    for (uint k = 0, i = grid_item(0); i < tried(); i = grid_item(++k)) {
        Move m = search(link_of(i));
        moves.move[i] = m;
        if (m.to == NONE) continue;
        for (Path path = path_of(link_of(i), m); path.slot != NONE; advance(path)) atomicMax(gains.word[path.slot], m.gain);
    }
}
#endif
