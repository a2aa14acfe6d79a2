// What the leaves of a build hold: its primitives, or the references that bvh/split.glsl has made of triangles, each the part of
// a triangle that lies in a box.
#ifndef HEDGEROW_BVH_REFERENCES
#define HEDGEROW_BVH_REFERENCES
#include "gpu/pass.glsl"
#include "bvh/layout.glsl"

struct Reference {
    vec3 lo;
    uint primitive;   // NO_PRIMITIVE: there is none
    vec3 hi;
    uint left_out;    // 0, or why it is in no leaf: a status bit or INACTIVE
};

const uint NO_PRIMITIVE = 0xFFFFFFFFu;

BUFFER References { Reference reference[]; };

// A grid of cells over the scene, a power of two of them along each axis.
struct SplitGrid {
    vec3 lo;
    vec3 cell;              // the extent of one; 0 along an axis that is not split
    vec3 cells_per_length;
    uvec3 level;            // of the plane in the middle: how many halvings shorter the axis is than the longest
    float scale;            // the power of two that brings the longest extent into [1/2, 1); 0: nothing is split
};

const uint SPLIT_WEIGHTS = 800;

BUFFER SplitState {
    uint lo[3];             // of the scene: `ordered` floats
    uint hi[3];
    uint primitive_count;   // of the input
    uint factor;            // what weights are multiplied by
    SplitGrid grid;
    uint histogram[SPLIT_WEIGHTS];
};
#endif
