// The example engine's shader: a picture of whatever stands in the structure, lit by one lamp with shadows.
//
// It owes the library nothing but the header: names, push constants and buffers are its own.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#include "trace/query.glsl"

layout(local_size_x = 64) in;

layout(buffer_reference, scalar) readonly buffer Positions { vec3 at[]; };
layout(buffer_reference, scalar) readonly buffer Triangles { uvec3 corners[]; };
layout(buffer_reference, scalar) writeonly buffer Picture { uint rgba[]; };

layout(push_constant, scalar) uniform Engine {
    hedgerowAccelerationStructure scene;
    Positions positions;
    Triangles triangles;
    Picture picture;
    uint width;
    uint height;
    vec3 eye;
    vec3 lamp;
};

// As written for GLSL_EXT_ray_query, with the names changed.
bool traced(vec3 origin, vec3 direction, float t_max, uint flags, out float t, out uint primitive) {
    HedgerowRayQuery query;
    hedgerowRayQueryInitialize(query, scene, hedgerowRayFlagsOpaque | flags, 0xff, origin, 0.0, direction, t_max);
    while (hedgerowRayQueryProceed(query)) {}
    t = hedgerowRayQueryGetIntersectionT(query, true);
    primitive = hedgerowRayQueryGetIntersectionPrimitiveIndex(query, true);
    return hedgerowRayQueryGetIntersectionType(query, true) == hedgerowRayQueryCommittedIntersectionTriangle;
}

vec3 normal_of(uint triangle, vec3 towards) {
    uvec3 c = triangles.corners[triangle];
    vec3 n = normalize(cross(positions.at[c.y] - positions.at[c.x], positions.at[c.z] - positions.at[c.x]));
    return dot(n, towards) < 0.0 ? -n : n;
}

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    if (pixel >= width * height) return;
    vec2 at = (vec2(pixel % width, pixel / width) + 0.5) / vec2(width, height) * 2.0 - 1.0;
    vec3 forward = normalize(-eye);
    vec3 right = normalize(cross(forward, vec3(0.0, 1.0, 0.0)));
    vec3 up = cross(right, forward);
    vec3 direction = forward + 0.4 * (at.x * right * float(width) / float(height) - at.y * up);

    vec3 colour = mix(vec3(0.75, 0.82, 0.9), vec3(0.35, 0.5, 0.7), 0.5 - 0.5 * at.y);
    float t;
    uint triangle;
    if (traced(eye, direction, 1e30, hedgerowRayFlagsNone, t, triangle)) {
        vec3 normal = normal_of(triangle, -direction);
        vec3 point = eye + t * direction + 1e-3 * normal;
        float unused_t;
        uint unused;
        bool shadowed = traced(point, lamp - point, 1.0, hedgerowRayFlagsTerminateOnFirstHit, unused_t, unused);
        float light = shadowed ? 0.0 : max(dot(normal, normalize(lamp - point)), 0.0);
        colour = vec3(0.9, 0.8, 0.65) * (0.2 + 0.8 * light);
    }
    picture.rgba[pixel] = packUnorm4x8(vec4(sqrt(colour), 1.0));
}
