#version 460
// The bounds of all triangles and of their centroids: see bvh/lbvh.glsl for the contract.
#include "bvh/lbvh.glsl"

void main() {
    lbvh_bounds(gl_WorkGroupID.x);
}
