#version 460
// The sum of the tiles' figures, over the root's area: see bvh/quality.glsl for the contract.
#include "bvh/quality.glsl"

shared Figures partial[gl_WorkGroupSize.x];

void main() {
    Figures sum = no_figures();
    for (uint tile = gl_LocalInvocationIndex; tile < tiles; tile += gl_WorkGroupSize.x) add(sum, partials.tile[tile]);
    partial[gl_LocalInvocationIndex] = sum;
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        for (uint i = 1; i < gl_WorkGroupSize.x; ++i) add(sum, partial[i]);
        Child root = structure.header.root;
        float scale = scale_of(root);
        // A root that is a leaf is in no node.
        if (structure.header.active_count != 0 && root.count != 0) count_leaf(sum, root, 0, scale);
        float area = relative_area(root.lo, root.hi, scale);
        sum.inner_area = area > 0.0 ? sum.inner_area / area : 0.0;
        sum.leaf_area = area > 0.0 ? sum.leaf_area / area : 0.0;
        result.tile[0] = sum;
    }
}
