// What the leaves of a build hold: its primitives, or the references that bvh/split.glsl has made of triangles, each the part of
// a triangle that lies in a box. They lie in scratch memory before the build's state.
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

// Bytes of a SplitState, with room to spare: STATE_BYTES in src/bvh/split.rs.
const uint SPLIT_STATE_BYTES = 3328;

// end - count * stride.
uvec2 address_before(uvec2 end, uint count, uint stride) {
    uint high, low, borrow;
    umulExtended(count, stride, high, low);
    end.x = usubBorrow(end.x, low, borrow);
    end.y -= high + borrow;
    return end;
}

SplitState split_state_before(uvec2 build_state) {
    return SplitState(address_before(build_state, 1u, SPLIT_STATE_BYTES));
}

References references_before(uvec2 build_state, uint count) {
    return References(address_before(uvec2(split_state_before(build_state)), count, 32u));
}
#endif
