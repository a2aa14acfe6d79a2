// What rays did in a tree, by its links, as src/bvh/counts.rs describes it.
#ifndef HEDGEROW_BVH_COUNTS
#define HEDGEROW_BVH_COUNTS
#include "gpu/pass.glsl"

struct LinkCount {
    uint entered;
    uint hits;
    uint work;
};

BUFFER LinkCounts { LinkCount count[]; };
#endif
