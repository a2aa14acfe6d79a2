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

// How many places a subtree takes of those that it is given. `cheaper` has a bit for each number of places from 2 on: whether the subtree
// costs less in them than in one less. A leaf has none of these bits, and takes one place.
uint places_within(uint cheaper, uint places) {
    // The number of its highest bit is what the exponent of a float says: lavapipe's own way to it is several times as long.
    uint in_them = cheaper & (1u << places - 1u) - 1u;
    return (floatBitsToUint(float(int(2u * in_them + 1u))) >> 23) - 126u;
}

uint places_by(uint choice, uint places) {
    return places_within(choice >> CHOICE_CHEAPER, places);
}

// How many children it has as a wide node.
uint children_by(uint choice) {
    return 2u + (choice >> CHOICE_CHILDREN & 7u);
}
#endif
