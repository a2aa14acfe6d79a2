#version 460
// The box around each tile of boxes. Recorded again and again until one box is left (src/gpu/reduce.rs, with the twin).
//
// reads   boxes[count]
// writes  results[tiles]; of no boxes, one empty box
// needs   one barrier before and after; any subgroup size
#include "gpu/pass.glsl"

struct Bounds {
    vec3 lo;
    vec3 hi;
};

BUFFER Boxes { Bounds bounds[]; };

layout(push_constant, scalar) uniform ReduceArguments {
    Boxes boxes;
    Boxes results;
    uint count;
    uint rounds;   // boxes of an invocation in a tile
};

// A workgroup may have as many subgroups as invocations.
shared Bounds partial[gl_WorkGroupSize.x];

void main() {
    Bounds around = Bounds(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
    uint first = group_number() * gl_WorkGroupSize.x * rounds + gl_LocalInvocationIndex;
    for (uint round = 0; round < rounds; ++round) {
        uint i = first + round * gl_WorkGroupSize.x;
        if (i < count) {
            Bounds b = boxes.bounds[i];
            around = Bounds(min(around.lo, b.lo), max(around.hi, b.hi));
        }
    }
    around = Bounds(subgroupMin(around.lo), subgroupMax(around.hi));
    if (subgroupElect()) partial[gl_SubgroupID] = around;
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        for (uint s = 1; s < gl_NumSubgroups; ++s) {
            around = Bounds(min(around.lo, partial[s].lo), max(around.hi, partial[s].hi));
        }
        results.bounds[group_number()] = around;
    }
}
