#version 460
// Opens the nodes of a level: see bvh/wide/collapse.glsl for the contract.
#include "bvh/wide/open.glsl"

void main() {
    uvec2 of = opened_of(level);
    if (of.y == 0) return;
    if (invocation_number() == 0) note_end(level, of.x + of.y);
    // All invocations of a workgroup go round together.
    for (uint k = 0, i = grid_item(0); i - gl_LocalInvocationIndex < of.y; i = grid_item(++k)) open(i, of, level);
}
