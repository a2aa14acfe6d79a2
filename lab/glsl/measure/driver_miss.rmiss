// A ray of measure/driver_rays.rgen that met nothing.
//
// writes  the payload
// needs   nothing
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_ray_tracing : require
#include "measure/rays.glsl"

layout(location = 0) rayPayloadInEXT Hit met;

void main() {
    met = no_hit();
}
