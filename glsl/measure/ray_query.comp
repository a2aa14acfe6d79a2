// Traces rays through the driver's own acceleration structure: the peer of trace/, with its rays and its hits.
//
// reads   rays[first..count], the structure          the structure built by VK_KHR_acceleration_structure
// writes  hits[first..count]
// needs   a barrier (acceleration-structure write -> read) before and one after; any subgroup size
// wants   a device with VK_KHR_ray_query: the pipeline is made only there
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_ray_query : require

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;

struct Ray {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

struct Hit {
    float t;
    uint primitive;
    float u;
    float v;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Rays { Ray ray[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer Hits { Hit hit[]; };
layout(push_constant, scalar) uniform Arguments { uvec2 structure; Rays rays; Hits hits; uint first; uint count; };

void main() {
    uint i = first + gl_GlobalInvocationID.x;
    if (i >= count) return;
    Ray ray = rays.ray[i];

    rayQueryEXT query;
    const uint flags = gl_RayFlagsOpaqueEXT | (ANY_HIT ? gl_RayFlagsTerminateOnFirstHitEXT : 0u);
    rayQueryInitializeEXT(query, accelerationStructureEXT(structure), flags, 0xFF, ray.origin, ray.t_min, ray.direction,
                          ray.t_max);
    // Every triangle is opaque, so that nothing is left to decide between candidates.
    while (rayQueryProceedEXT(query)) {}

    Hit hit = Hit(uintBitsToFloat(0x7F800000u), 0xFFFFFFFFu, 0.0, 0.0);
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
        hit.t = ANY_HIT ? 0.0 : rayQueryGetIntersectionTEXT(query, true);
        hit.primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        hit.u = uv.x;
        hit.v = uv.y;
    }
    hits.hit[i] = hit;
}
