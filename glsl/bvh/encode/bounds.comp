#version 460
// The bounds of all triangles and of their centroids: see bvh/encode.glsl for the contract.
#include "bvh/encode.glsl"

void main() {
    find_bounds(group_number());
}
