// The example engine's shader: a picture of whatever stands in the structure, lit by one lamp with shadows.
//
// It owes the library nothing but the header: names, push constants and buffers are its own. It is written for
// GLSL_EXT_ray_query; the header of names makes of it what runs on any device.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#include "trace/ray_query_names.glsl"

layout(local_size_x = 64) in;

layout(buffer_reference, scalar) readonly buffer Positions { vec3 at[]; };
layout(buffer_reference, scalar) readonly buffer Triangles { uvec3 corners[]; };
layout(buffer_reference, scalar) writeonly buffer Picture { uint rgba[]; };

layout(push_constant, scalar) uniform Engine {
    accelerationStructureEXT scene;
    Positions positions;
    Triangles triangles;
    Picture picture;
    uint width;
    uint height;
    vec3 eye;
    vec3 lamp;
};

// What a ray meets: how far, and the normal there, towards where it came from.
bool traced(vec3 origin, vec3 direction, float t_max, uint flags, out float t, out vec3 normal) {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT | flags, 0xff, origin, 0.0, direction, t_max);
    while (rayQueryProceedEXT(query)) {}
    if (rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionTriangleEXT) return false;
    t = rayQueryGetIntersectionTEXT(query, true);
    // The instance's own number is where its part's triangles begin.
    uint first = rayQueryGetIntersectionInstanceCustomIndexEXT(query, true);
    uvec3 c = triangles.corners[first + rayQueryGetIntersectionPrimitiveIndexEXT(query, true)];
    mat4x3 to_world = rayQueryGetIntersectionObjectToWorldEXT(query, true);
    vec3 a = to_world * vec4(positions.at[c.y] - positions.at[c.x], 0.0);
    vec3 b = to_world * vec4(positions.at[c.z] - positions.at[c.x], 0.0);
    vec3 n = normalize(cross(a, b));
    normal = dot(n, direction) > 0.0 ? -n : n;
    return true;
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
    vec3 normal;
    if (traced(eye, direction, 1e30, gl_RayFlagsNoneEXT, t, normal)) {
        vec3 point = eye + t * direction + 1e-3 * normal;
        float unused_t;
        vec3 unused;
        bool shadowed = traced(point, lamp - point, 1.0, gl_RayFlagsTerminateOnFirstHitEXT, unused_t, unused);
        float light = shadowed ? 0.0 : max(dot(normal, normalize(lamp - point)), 0.0);
        colour = vec3(0.9, 0.8, 0.65) * (0.2 + 0.8 * light);
    }
    picture.rgba[pixel] = packUnorm4x8(vec4(sqrt(colour), 1.0));
}
