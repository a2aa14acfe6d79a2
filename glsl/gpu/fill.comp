#version 460
// Fills words with a value (src/gpu/fill.rs).
//
// writes  words[count]
// needs   a barrier after; any subgroup size
#include "gpu/pass.glsl"

layout(constant_id = 1) const uint ROUNDS = 1;

layout(push_constant, scalar) uniform FillArguments {
    Words words;
    uint count;
    uint value;
};

void main() {
    uint first = group_number() * gl_WorkGroupSize.x * ROUNDS + gl_LocalInvocationIndex;
    for (uint round = 0; round < ROUNDS; ++round) {
        uint i = first + round * gl_WorkGroupSize.x;
        if (i < count) words.word[i] = value;
    }
}
