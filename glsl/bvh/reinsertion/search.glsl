// The step `search` of bvh/reinsertion.glsl: the best move of each subtree, and its gain on all nodes of its path.
#ifndef HEDGEROW_BVH_REINSERTION_SEARCH
#define HEDGEROW_BVH_REINSERTION_SEARCH
#include "bvh/reinsertion.glsl"

// Subtrees that are put off; what does not find room is not looked at.
const uint STACK = 32;
// Of those, the first that lie in shared memory: a GPU has an invocation's own arrays far away.
layout(constant_id = 2) const uint SHARED_ENTRIES = 0;
// A gain counts if it is more than this share of the pivot's cost: less may be rounding.
const float LEAST_SHARE = 1.0 / 1048576.0;

// A search on its way: up from the parent, and at each node of that, the pivot, down on the other side.
struct Search {
    Box moving;
    float moving_cost;
    float moving_by_rays;   // the part of its cost that is not its area
    uint sibling;           // the link beside the one where it hangs
    uint at;                // the link below the pivot on the way up
    uint level;             // nodes of the way up that were looked at
    uint pivot;
    float least;            // what a gain must exceed at this pivot
    float saved;            // what all nodes cost less, without a new one
    Box left_behind;        // what is left below the pivot on the side that the subtree leaves
    uint visits;
    uint height;            // subtrees that are put off
    uint best_to;
    uint best_pivot;
    float best_gain;
};

// Of all of them.
float area_scale;
float rays_weigh;
uint root;

// A node that may be looked into, and what would be saved if the move went below it.
struct Below {
    uint slot;
    float saved;
};

// Of a search. Each is a pivot, a visit below, or a subtree less that is put off; a visit puts off one.
const uint TURNS = LEVELS + 2 * VISITS + 1;

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
    precise float left = saved - (merged - cost_at(at, child, area_scale));
    return Below(child.count == 0u ? child.index : NONE, left);
}

// What a box by rays costs at least, around what moves and a child of this cost: to ask the grid takes many times as long.
float least_cost(Search s, Box merged, Child child, float cost) {
    precise float by_rays = cost - area_of(box_of(child), area_scale);
    precise float least = area_of(merged, area_scale) + max(by_rays, s.moving_by_rays);
    return least;
}

// What a move to link `at`, where `child` hangs, would gain, if that `counts`. Beside the own sibling a move would tie a cycle: the
// box around both is the parent's, which costs what is saved, so it gains nothing.
Below look(inout Search s, uint at, Child child, float saved, bool counts) {
    Box box = around(box_of(child), s.moving);
    bool is_sibling = at == s.sibling;
    if (BY_RAYS && !is_sibling) {
        float own = costs.value[at];
        float least = least_cost(s, box, child, own);
        precise float most = saved - least;
        precise float most_below = saved - (least - own) - s.moving_cost;
        if (most <= bar(s) && (child.count != 0u || most_below <= bar(s))) return Below(NONE, 0.0);
    }
    float merged = is_sibling ? saved : cost_of(box, area_scale, rays_weigh);
    precise float gain = saved - merged;
    if (counts && gain > bar(s)) {
        s.best_to = at;
        s.best_pivot = s.pivot;
        s.best_gain = gain;
    }
    Below next = below(at, child, saved, merged, s);
    if (!counts) next.slot = NONE;
    return next;
}

// Of a node, by rays.
float known_cost(uint slot) {
    return slot == root ? uintBitsToFloat(totals.word[TOTALS_ROOT]) : costs.value[parents.word[slot]];
}

// Of a subtree's best move, before anything was looked at.
Search search_from(uint link) {
    Box nothing = Box(vec3(0.0), vec3(0.0));
    return Search(nothing, 0.0, 0.0, link ^ 1u, link, 0u, NONE, 0.0, 0.0, nothing, 0u, 0u, NONE, NONE, 0.0);
}

// To the node at `slot`: the next pivot, or `next` below the one at hand. What to look into then, if it may gain.
Below visit(inout Search s, uint slot, Below next, bool goes_up) {
    Node node = structure.nodes[slot];
    bool is_left = (s.at & 1u) == 0u, begins = goes_up && s.level == 0u;
    Child from = is_left ? node.left : node.right, other = is_left ? node.right : node.left;
    Box pivot_box = around(box_of(node.left), box_of(node.right));
    float pivot_cost = 0.0;
    if (begins) {
        s.moving = box_of(from);
        s.moving_cost = cost_at(s.at, from, area_scale);
        precise float by_rays = s.moving_cost - area_of(s.moving, area_scale);
        s.moving_by_rays = by_rays;
    }
    if (goes_up) {
        s.pivot = slot;
        pivot_cost = BY_RAYS ? known_cost(slot) : area_of(pivot_box, area_scale);
        if (begins) s.saved = pivot_cost;
        s.least = max(LEAST_SHARE * pivot_cost, uintBitsToFloat(LEAST_GAIN));
        next.saved = s.saved;
    }
    s.visits += goes_up ? 0u : 1u;
    Below left = look(s, 2u * slot, node.left, next.saved, !goes_up || !is_left);
    Below right = look(s, 2u * slot + 1u, node.right, next.saved, !goes_up || is_left);
    bool swap = right.saved > left.saved;
    Below far = left, near = right;
    if (!swap) {
        far = right;
        near = left;
    }
    bool far_may_gain = may_gain(s, far), near_may_gain = may_gain(s, near);
    if (far_may_gain && near_may_gain && s.height < STACK) put(s.height++, far);
    if (!near_may_gain) near = far;
    if (s.visits == VISITS) {
        near.slot = NONE;
        s.height = 0u;
    }
    if (goes_up) {
        Box both = around(s.left_behind, box_of(other));
        // What is inside of a box, and does not touch its faces, leaves it as it is.
        if (!begins && (!BY_RAYS || both != pivot_box)) {
            precise float saved = s.saved + (pivot_cost - cost_of(both, area_scale, rays_weigh));
            s.saved = saved;
        }
        s.left_behind = both;
        if (begins) s.left_behind = box_of(other);
        s.level++;
    }
    return near;
}

// Up and down in one loop: invocations side by side go on while others look into more below their pivots.
Move search(uint link) {
    Search s = search_from(link);
    Below next = Below(NONE, 0.0);
    bool stays = !is_used(link >> 1) || link >> 1 == root, ends = false;
    for (uint turn = 0; turn < TURNS && !stays && !ends; ++turn) {
        if (!may_gain(s, next) && s.height != 0u) next = take(--s.height);
        bool goes_below = may_gain(s, next), goes_up = !goes_below && s.height == 0u;
        ends = goes_up && (s.level == LEVELS || s.pivot == root);
        if (goes_up && !ends && s.level != 0u) s.at = parents.word[s.pivot];
        if ((goes_below || goes_up) && !ends) next = visit(s, goes_up ? s.at >> 1 : next.slot, next, goes_up);
    }
    return Move(s.best_to, s.best_pivot, min(floatBitsToUint(s.best_gain), MOST_GAIN));
}

void search_moves() {
    if (AREAS != AREAS_WHOLE) clip = part.box;
    area_scale = structure.header.area_scale;
    rays_weigh = ratio();
    root = structure.header.root.index;
    for (uint k = 0, i = grid_item(0); i < tried(); i = grid_item(++k)) {
        Move m = search(link_of(i));
        moves.move[i] = m;
        if (m.to == NONE) continue;
        for (Path path = path_of(link_of(i), m); path.slot != NONE; advance(path)) atomicMax(gains.word[path.slot], rank_of_gain(m.gain));
    }
}
#endif
