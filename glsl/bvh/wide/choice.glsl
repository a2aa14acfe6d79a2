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

// How many of up to so many places the subtree takes: more would not make it cheaper.
uint places_by(uint choice, uint places) {
    return uint(findMSB(choice >> CHOICE_CHEAPER & (1u << places - 1u) - 1u) + 2);
}

// How many children it has as a wide node.
uint children_by(uint choice) {
    return 2u + (choice >> CHOICE_CHILDREN & 7u);
}
#endif
