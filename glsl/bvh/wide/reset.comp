#version 460
// The root as the only node of the first level: see bvh/wide/collapse.glsl for the contract.
#include "bvh/wide/collapse.glsl"

void main() {
    Header header = source.header;
    bool there_is = can_be_collapsed(header);
    for (uint l = gl_LocalInvocationIndex; l < LEVELS_AT_MOST; l += gl_WorkGroupSize.x) {
        levels.count[l] = l == 0 && there_is ? 1 : 0;
    }
    if (gl_LocalInvocationIndex == 0) {
        levels.first[0] = 0;
        levels.end = 0;
    }
    // A tree that is a leaf has no slot: the first one then stands for it.
    if (gl_LocalInvocationIndex == 0) opened.node[0] = Opened(is_inner(header.root) ? header.root.index : 0, 0);
}
