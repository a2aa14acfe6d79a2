#version 460
// Opens the nodes of several levels, by one workgroup: see bvh/wide/collapse.glsl for the contract.
//
// For levels of few nodes: the first ones, and those that only trees out of balance have.
#include "bvh/wide/open.glsl"

void main() {
    for (uint l = level; l < level_end; ++l) {
        uvec2 of = opened_of(l);
        if (of.y == 0) break;
        for (uint i = gl_LocalInvocationIndex; i - gl_LocalInvocationIndex < of.y; i += gl_WorkGroupSize.x) open(i, of, l);
        if (gl_LocalInvocationIndex == 0) note_end(l, of.x + of.y);
        release_to_device();
        barrier();
        acquire_from_device();
    }
}
