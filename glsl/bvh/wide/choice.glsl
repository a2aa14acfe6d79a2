// What was chosen for a binary node: `Choice` in src/bvh/twin/wide/costs.rs, which has the bits. A subtree takes places among the children
// of a wide node.
#ifndef HEDGEROW_BVH_WIDE_CHOICE
#define HEDGEROW_BVH_WIDE_CHOICE

const uint CHOICE_CHEAPER = 21;
const uint CHOICE_CHILDREN = 27;

// How many of the places that the children share the left one gets.
uint places_of_left_by(uint choice, uint places) {
    return choice >> 3u * places - 6u & 7u;
}

// How many of up to so many places a subtree takes that is cheaper, by a bit for each from 2 places on, in more: others would not make it
// cheaper. A leaf, which has no such bit, takes one.
uint places_within(uint cheaper, uint places) {
    return uint(findMSB(cheaper & (1u << places - 1u) - 1u) + 2);
}

uint places_by(uint choice, uint places) {
    return places_within(choice >> CHOICE_CHEAPER, places);
}

// How many children it has as a wide node.
uint children_by(uint choice) {
    return 2u + (choice >> CHOICE_CHILDREN & 7u);
}
#endif
