// What every ray kernel takes: rays, where hits and work go, and the structure.
#ifndef HEDGEROW_TRACE_BUFFERS
#define HEDGEROW_TRACE_BUFFERS
#include "gpu/division.glsl"
#include "bvh/layout.glsl"
#include "trace/ray.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Rays { HedgerowRay ray[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Hits { HedgerowHit hit[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer Works { uvec3 work[]; };

layout(buffer_reference, scalar, buffer_reference_align = 4) nonprivate buffer Sums { uint word[]; };

layout(push_constant, scalar) uniform TraceArguments {
    Structure structure;
    Rays rays;
    Hits hits;
    Works works;
    Sums sums;         // of trial/work.comp, as all behind rays_each: it takes a part of the rays, and adds up their work
    uint first;
    uint count;
    uint rays_each;
    uint stride;
    uint start;
    uint c_t;
    uint c_i;
};

// Whether it is of the kind whose nodes a kernel walks, and there is something in it.
bool can_be_traced(Structure structure, uint kind) {
    return structure.header.kind == kind && structure.header.active_count != 0u && (structure.header.status & STATUS_UNUSABLE) == 0u;
}
#endif
