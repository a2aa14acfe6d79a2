#version 460
// Copies 16-byte words, one an invocation: the rate that the phases of a build are held against (lab/src/measure/copy.rs).
//
// reads   source[count]
// writes  target[count]
// needs   a barrier after; any subgroup size
#include "gpu/pass.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Source { uvec4 word[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer Target { uvec4 word[]; };

layout(push_constant, scalar) uniform CopyWordsArguments {
    Source source;
    Target target;
    uint count;
};

void main() {
    uint i = invocation_number();
    if (i < count) target.word[i] = source.word[i];
}
