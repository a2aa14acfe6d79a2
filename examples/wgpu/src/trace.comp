// The engine's own shader: what `hedgerow render --view normals` shows, in linear light. Four rays a pixel, and the colour of each is
// the normal of the triangle that it meets.
//
// reads   the structure, positions and triangles: written before, with a barrier between
// writes  light[pixel]
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#include "trace/query.glsl"

layout(local_size_x = 64) in;

layout(buffer_reference, scalar) readonly buffer Positions { vec3 at[]; };
layout(buffer_reference, scalar) readonly buffer Triangles { uvec3 corners[]; };
layout(buffer_reference, scalar) writeonly buffer Picture { vec4 light[]; };

layout(push_constant, scalar) uniform Push {
    hedgerowAccelerationStructure scene;
    Positions positions;
    Triangles triangles;
    Picture picture;
    uvec2 size;
    vec3 eye;
    // From the eye to the picture's middle, and from there to its right and its upper edge.
    vec3 forward;
    vec3 right;
    vec3 up;
};

vec3 colour_along(vec3 direction) {
    HedgerowRayQuery query;
    hedgerowRayQueryInitialize(query, scene, hedgerowRayFlagsOpaque, 0xff, eye, 0.0, direction, 1e30);
    while (hedgerowRayQueryProceed(query)) {}
    if (hedgerowRayQueryGetIntersectionType(query, true) != hedgerowRayQueryCommittedIntersectionTriangle) return vec3(0.0);
    uvec3 c = triangles.corners[hedgerowRayQueryGetIntersectionPrimitiveIndex(query, true)];
    vec3 a = positions.at[c.x];
    vec3 normal = normalize(cross(positions.at[c.y] - a, positions.at[c.z] - a));
    if (dot(normal, direction) > 0.0) normal = -normal;
    return pow(0.5 + 0.5 * normal, vec3(2.2));
}

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    if (pixel >= size.x * size.y) return;
    uvec2 corner = 2u * uvec2(pixel % size.x, pixel / size.x);
    vec3 light = vec3(0.0);
    for (uint i = 0u; i < 4u; i++) {
        vec2 at = (vec2(corner + uvec2(i % 2u, i / 2u)) + 0.5) / vec2(size) - 1.0;
        light += colour_along(forward + at.x * right - at.y * up);
    }
    picture.light[pixel] = vec4(light / 4.0, 1.0);
}
