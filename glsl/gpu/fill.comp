// Fills words with a value.
//
// writes  words[count]
// needs   a barrier after; any subgroup size
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require

layout(local_size_x_id = 0) in;
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words { uint word[]; };
layout(push_constant, scalar) uniform Arguments { Words words; uint count; uint value; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < count) words.word[i] = value;
}
