// What is merged at a time in H-PLOC: the clusters of two siblings of the radix tree.
#ifndef HEDGEROW_BVH_HPLOC_WINDOW
#define HEDGEROW_BVH_HPLOC_WINDOW
#include "bvh/clusters.glsl"

layout(constant_id = 7) const uint WINDOW = 32;
layout(constant_id = 8) const uint RADIUS = 8;
const uint HALF_WINDOW = WINDOW / 2;
// Whether each invocation merges its own windows, which are of 8 clusters at most and look at all of them; or teams do.
layout(constant_id = 9) const bool BY_ONE = false;

// The clusters of two siblings: their records are named by the list from `left` and from `right` on.
struct Request {
    uint left;
    uint left_count;
    uint right;
    uint right_count;
    bool is_whole;    // they are all that there are
};

const Request NO_REQUEST = Request(0u, 0u, 0u, 0u, false);

// Where the records of a subtree's clusters lie, from its first position on.
Words cluster_list() {
    return Words(part(parts.lists[0]));
}

// How many clusters a window leaves, at most.
uint most_left(Request request) {
    return request.is_whole ? 1u : HALF_WINDOW;
}
#endif
