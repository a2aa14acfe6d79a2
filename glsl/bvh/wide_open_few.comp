#version 460
// Opens the nodes of several levels, by one workgroup: see bvh/wide_collapse.glsl for the contract.
//
// For levels of few nodes: the first ones, and those that only trees out of balance have.
#include "bvh/wide_open.glsl"

void main() {
    for (uint l = level; l < level_end; ++l) {
        uint first = opened_before(l);
        uint count = opened_of(l);
        for (uint i = gl_LocalInvocationIndex; i < count; i += gl_WorkGroupSize.x) open(first + i, l, first + count);
        release_to_device();
        barrier();
        acquire_from_device();
    }
}
