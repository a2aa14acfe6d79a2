// What a ray of measure/driver_rays.rgen met: the closest hit, or the one that ended it.
//
// writes  the payload
// needs   opaque triangles
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_ray_tracing : require
#include "measure/rays.glsl"

layout(location = 0) rayPayloadInEXT Hit met;
hitAttributeEXT vec2 weights;

void main() {
    met.t = ANY_HIT ? 0.0 : gl_HitTEXT;
    // Instances are numbered by their first primitives, where those of several are to be told apart.
    met.primitive = uint(gl_InstanceCustomIndexEXT) + uint(gl_PrimitiveID);
    met.u = weights.x;
    met.v = weights.y;
}
