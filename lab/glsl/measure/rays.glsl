// Rays and hits of the shaders that are measured: the same for the driver's structures and ours.
#ifndef HEDGEROW_MEASURE_RAYS
#define HEDGEROW_MEASURE_RAYS
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
layout(constant_id = 1) const bool ANY_HIT = false;

// Beside our queries it is their ray.
#ifdef HEDGEROW_TRACE_RAY
#define GivenRay HedgerowRay
#else
struct GivenRay {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};
#endif

struct Hit {
    float t;
    uint primitive;
    float u;
    float v;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Rays { GivenRay ray[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer Hits { Hit hit[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer Works { uvec4 work[]; };
layout(push_constant, scalar) uniform TraceQueriesArguments { uvec2 structure; Rays rays; Hits hits; Works works; uint first; uint count; };

Hit no_hit() {
    return Hit(uintBitsToFloat(0x7F800000u), 0xFFFFFFFFu, 0.0, 0.0);
}
#endif
