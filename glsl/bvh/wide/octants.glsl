// Children in slots by the octants that they lie in: the twin of `octant_slots` in src/bvh/twin/wide.rs, which says why.
//
// Arrays are indexed by constants alone, so that they stay in registers, by a call for each child: where shaderc unrolls a loop, the copies
// of what is `precise` are not.
#ifndef HEDGEROW_BVH_WIDE_OCTANTS
#define HEDGEROW_BVH_WIDE_OCTANTS
#include "bvh/wide/children.glsl"

const uint NO_SLOT = 8;

// What a child's middle is from that of the node, and how far by the sum of the axes; NO_DISTANCE: it has a slot, or there is none.
vec3 octant_from[8];
float octant_far[8];

const float NO_DISTANCE = -1.0;

vec3 quarter_middle(Box b) {
    precise vec3 middle = 0.25 * b.lo + 0.25 * b.hi;
    return middle;
}

void measure_child(uint i, uint count, vec3 centre) {
    octant_from[i] = vec3(0.0);
    octant_far[i] = NO_DISTANCE;
    if (i < count) {
        Child child = child_named(open_name[i]);
        precise vec3 from = quarter_middle(Box(child.lo, child.hi)) - centre;
        precise float far = abs(from.x) + abs(from.y) + abs(from.z);
        octant_from[i] = from;
        octant_far[i] = far;
    }
}

// Of equal ones the first.
void choose_farthest(uint i, inout uint farthest, inout float distance, inout vec3 from) {
    bool is_farther = octant_far[i] > distance;
    farthest = is_farther ? i : farthest;
    distance = is_farther ? octant_far[i] : distance;
    from = mix(from, octant_from[i], bvec3(is_farther));
}

void forget_child(uint i, uint chosen) {
    octant_far[i] = i == chosen ? NO_DISTANCE : octant_far[i];
}

// Of equal ones the first that no child has yet.
void choose_slot(uint slot, float gain, uint taken, inout uint best, inout float most) {
    bool is_better = all(bvec2((taken >> slot & 1u) == 0u, any(bvec2(best == NO_SLOT, gain > most))));
    best = is_better ? slot : best;
    most = is_better ? gain : most;
}

// The slots of so many children of a node with this middle: four bits each.
uint octant_slots(uint count, vec3 centre) {
    measure_child(0, count, centre); measure_child(1, count, centre); measure_child(2, count, centre); measure_child(3, count, centre);
    measure_child(4, count, centre); measure_child(5, count, centre); measure_child(6, count, centre); measure_child(7, count, centre);
    uint slots = 0, taken = 0;
    for (uint round = 0; round < count; ++round) {
        uint child = 0, slot = NO_SLOT;
        float distance = NO_DISTANCE, most = 0.0;
        vec3 from = vec3(0.0);
        choose_farthest(0, child, distance, from); choose_farthest(1, child, distance, from);
        choose_farthest(2, child, distance, from); choose_farthest(3, child, distance, from);
        choose_farthest(4, child, distance, from); choose_farthest(5, child, distance, from);
        choose_farthest(6, child, distance, from); choose_farthest(7, child, distance, from);
        forget_child(0, child); forget_child(1, child); forget_child(2, child); forget_child(3, child);
        forget_child(4, child); forget_child(5, child); forget_child(6, child); forget_child(7, child);
        // What a slot gains is the sum of the axes, each by the side that the slot lies on.
        precise float both = from.x + from.y, apart = from.x - from.y;
        precise float both_and = both + from.z, both_less = both - from.z, apart_and = apart + from.z, apart_less = apart - from.z;
        choose_slot(0, -both_and, taken, slot, most); choose_slot(1, apart_less, taken, slot, most);
        choose_slot(2, -apart_and, taken, slot, most); choose_slot(3, both_less, taken, slot, most);
        choose_slot(4, -both_less, taken, slot, most); choose_slot(5, apart_and, taken, slot, most);
        choose_slot(6, -apart_less, taken, slot, most); choose_slot(7, both_and, taken, slot, most);
        taken |= 1u << slot;
        slots |= slot << 4 * child;
    }
    return slots;
}
#endif
