// The children of a wide node: those of a binary one, of which some are opened, as bvh/wide/costs.glsl has chosen. The twin is `open` in
// src/bvh/twin/wide.rs.
#ifndef HEDGEROW_BVH_WIDE_CHILDREN
#define HEDGEROW_BVH_WIDE_CHILDREN
#include "bvh/wide/choice.glsl"
#include "bvh/wide/collapse.glsl"
#include "bvh/wide/far.glsl"

// The children so far, in the order of a walk that takes left ones first. Indexed by constants alone: they stay in registers.
uint open_name[8];
uint open_index[8];
uint open_count[8];

// Links that the walk has before it, the next one first, with how many places each may take above NAME; 0 behind the last.
uvec4 waiting_next;
uvec4 waiting_behind;

void wait(uint name, uint places) {
    waiting_behind = uvec4(waiting_next.w, waiting_behind.xyz);
    waiting_next = uvec4(name | places << NAME_BITS, waiting_next.xyz);
}

uint take_next() {
    uint next = waiting_next.x;
    waiting_next = uvec4(waiting_next.yzw, waiting_behind.x);
    waiting_behind = uvec4(waiting_behind.yzw, 0u);
    return next;
}

void put_child(uint at, uint name, Child child) {
    [[unroll]] for (uint i = 0; i < 8; ++i) {
        bool is_here = i == at;
        open_name[i] = is_here ? name : open_name[i];
        open_index[i] = is_here ? child.index : open_index[i];
        open_count[i] = is_here ? child.count : open_count[i];
    }
}

// What names a child: by comparisons, so that all of them stay in registers.
uint name_of_child(uint child) {
    uint name = NO_CHILD;
    [[unroll]] for (uint i = 0; i < 8; ++i) name = i == child ? open_name[i] : name;
    return name;
}

// Edges of a child's box, of an area that counts.
vec3 edges_of(Child child) {
    return scaled_edges(Box(child.lo, child.hi), source.header.area_scale);
}

// Half of the area of a box in a quantised root: it may be a cell longer.
float area_in_root(Child child) {
    precise vec3 edges = edges_of(child) + edges_of(source.header.root) * (1.0 / 128.0);
    return half_area_of_edges(edges);
}

// Whether a visit of an inner child of a quantised root costs less than to have its children in the root, whose cells may be much larger
// than they are.
bool is_closed(Child child) {
    if (!QUANTISED) return false;
    Child left = child_named(2 * child.index), right = child_named(2 * child.index + 1);
    precise float opened = area_in_root(left) + area_in_root(right);
    precise float closed = area_in_root(child) + (half_area_of_edges(edges_of(left)) + half_area_of_edges(edges_of(right)));
    return opened > closed;
}

// The children of binary node `slot` share so many places.
void wait_for_children(uint slot, uint choice, uint places, bool by_cost) {
    uint of_left = by_cost ? places_of_left_by(choice, places) : places / 2;
    wait(2 * slot + 1, places - of_left);
    wait(2 * slot, of_left);
}

void wait_for_nothing() {
    waiting_next = uvec4(0u);
    waiting_behind = uvec4(0u);
}

// Puts down what the root holds where its first child is near and all others are far from that: how many, or 0 where they are not.
uint put_near_and_far() {
    uint first = name_of_near();
    if (first == NO_CHILD) return 0;
    Child near = child_named(first);
    put_child(0, first, near);
    uint count = 1, waiting = 1;
    bool all_are_far = true;
    wait_for_nothing();
    wait(first + 1, 1);
    for (uint turn = 0; turn < 14 && waiting_next.x != 0u && all_are_far; ++turn) {
        uint name = take_next() & NAME;
        Child other = child_named(name);
        waiting--;
        if (side_of(near, other, source.header.area_scale) != ON_NO_SIDE) {
            put_child(count, name, other);
            count++;
        } else if (is_inner(other) && count + waiting + 2 <= WIDTH) {
            // What lies on both sides reaches over what is near: its parts may be far.
            wait(2 * other.index + 1, 1);
            wait(2 * other.index, 1);
            waiting += 2;
        } else {
            all_are_far = false;
        }
    }
    return all_are_far ? count : 0;
}

// The children of the wide node that begins with the binary node `slot`: how many.
uint open_children(uint slot, uint level) {
    Child root = source.header.root;
    if (!is_inner(root)) {
        put_child(0, WHOLE_TREE, root);
        return 1;
    }
    bool by_cost = level < LEVELS_BY_COST;
    uint choice = by_cost ? choices.word[slot] : 0;
    uint apart = level == 0 ? put_near_and_far() : 0;
    wait_for_nothing();
    if (apart == 0) wait_for_children(slot, choice, WIDTH, by_cost);
    for (uint other = apart; other-- > 1;) wait(name_of_child(other), 1);
    // What is near stays closed. `room`: places that the choices leave free. No min() of what may be constant (src/gpu/workarounds.rs).
    uint count = apart == 0 ? 0 : 1, room = apart != 0 ? WIDTH - apart : by_cost ? WIDTH - children_by(choice) : 0;
    // Of n children 2 n - 2 links are taken.
    for (uint turn = 0; turn < 14 && waiting_next.x != 0u; ++turn) {
        uint next = take_next(), name = next & NAME, places = next >> NAME_BITS;
        Child child = child_named(name);
        bool inner = is_inner(child);
        if (inner && by_cost) {
            choice = choices.word[child.index];
            places = places_by(choice, places);
            // What fits as a whole is taken in, even where sums of costs were too large to tell.
            uint more = children_by(choice) - 1;
            if (places == 1 && more <= room) {
                places = WIDTH;
                room -= more;
            }
        }
        if (inner && places > 1 && !(level == 0 && is_closed(child))) {
            wait_for_children(child.index, choice, places, by_cost);
        } else {
            put_child(count, name, child);
            count++;
        }
    }
    return min(count, WIDTH);
}
#endif
