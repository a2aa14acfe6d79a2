// End-point overlap of a Bvh2 of triangles: src/bvh/epo.rs records the three steps, src/bvh/twin/epo.rs is the twin.
// Aila, Karras, Laine 2013, section 3.2.
//
//   parents   reads nodes                        writes parents (filled with NONE before)
//   overlaps  reads nodes, records, parents      writes sums[record]
//   sum       reads sums                         writes fewer of them; recorded until one is left
//
// What names a slot or a record is 2 · slot + side. Each record has a sum of its own, and sums are added in an order that follows
// from their number alone: the result is the same on every run and for every subgroup size.
//
// needs  one barrier between each two; any subgroup size
#ifndef HEDGEROW_BVH_EPO
#define HEDGEROW_BVH_EPO
#include "gpu/pass.glsl"
#include "bvh/layout.glsl"

const uint NONE = 0xFFFFFFFFu;

// Areas: Σ over inner nodes of what lies in them and is not of them, the same over leaves times triangles, and of the surface.
BUFFER Sums { vec3 of[]; };

layout(push_constant, scalar) uniform EpoArguments {
    Structure structure;
    Words parents;     // of each slot, then of each record
    Sums sums;
    Sums results;
    uint first;        // record, or sum
    uint count;
    uint rounds;       // records of an invocation
};
#endif
