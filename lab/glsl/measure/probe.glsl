// Everything that a ray query reports, for each ray: of the driver's queries or, with WITH_HEDGEROW, of ours.
//
// A ray says how its candidates are decided on; the first eight are written down as they come. With IN_TURN, which ours can, an
// invocation has five rays, and `told` is the structure that its turns are told of; with HEDGEROW_LANES, which has to be a workgroup's
// invocations, these are loaded for lane by lane. With WITH_ANOTHER, another query of each ray, into `told`, goes on whenever its first has a
// candidate; each time the kind of what it has committed to, 0 if nothing, is added to the opaque boxes.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#ifdef WITH_HEDGEROW
#include "trace/ray_query_names.glsl"
#else
#extension GL_EXT_ray_query : require
#endif

#ifdef HEDGEROW_LANES
layout(local_size_x_id = 0) in;
#else
layout(local_size_x = 64) in;
#endif

const uint IGNORE = 0;
const uint CONFIRM = 1;
const uint CONFIRM_ODD = 2;
const uint TERMINATE = 3;
const uint CANDIDATES = 8;

struct ProbeRay {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
    uint flags;
    uint mask;
    uint decision;
    float generated_t;
};

struct Meeting {
    uint type;
    float t;
    uint instance;
    uint custom_index;
    uint offset;
    uint geometry;
    uint primitive;
    uint is_front;
    vec2 barycentrics;
    vec3 object_origin;
    vec3 object_direction;
    mat4x3 object_to_world;
    mat4x3 world_to_object;
};

struct Report {
    Meeting committed;
    float t_min;
    uint flags;
    vec3 origin;
    vec3 direction;
    uint candidate_count;
    // type, instance, geometry, primitive
    uvec4 candidates[CANDIDATES];
    uint opaque_boxes;
};

layout(buffer_reference, scalar) readonly buffer Rays { ProbeRay ray[]; };
layout(buffer_reference, scalar) writeonly buffer Reports { Report report[]; };
layout(push_constant, scalar) uniform ProbeArguments { uvec2 structure; uvec2 told; Rays rays; Reports reports; uint count; };

rayQueryEXT query;
#ifdef WITH_ANOTHER
rayQueryEXT another;
#endif
ProbeRay ray;
Report r;

void begin(uint i) {
    ray = rays.ray[i];
    for (uint k = 0; k < CANDIDATES; ++k) r.candidates[k] = uvec4(0);
    r.candidate_count = 0;
    r.opaque_boxes = 0;
#ifdef WITH_ANOTHER
    hedgerowRayQueryInitializeAt(query, 1u, HedgerowStructure(structure), ray.flags, ray.mask, ray.origin, ray.t_min, ray.direction, ray.t_max);
    hedgerowRayQueryInitialize(another, HedgerowStructure(told), ray.flags, ray.mask, ray.origin, ray.t_min, ray.direction, ray.t_max);
#else
    rayQueryInitializeEXT(query, accelerationStructureEXT(structure), ray.flags, ray.mask, ray.origin, ray.t_min, ray.direction, ray.t_max);
#endif
}

void decide() {
    uint type = rayQueryGetIntersectionTypeEXT(query, false);
    uint primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, false);
    if (r.candidate_count < CANDIDATES) {
        r.candidates[r.candidate_count] = uvec4(type, rayQueryGetIntersectionInstanceIdEXT(query, false),
                                                rayQueryGetIntersectionGeometryIndexEXT(query, false), primitive);
    }
    r.candidate_count += 1;
    bool confirms = ray.decision == CONFIRM || ray.decision == CONFIRM_ODD && (primitive & 1) != 0;
    if (type == gl_RayQueryCandidateIntersectionTriangleEXT) {
        if (confirms) rayQueryConfirmIntersectionEXT(query);
    } else {
        if (rayQueryGetIntersectionCandidateAABBOpaqueEXT(query)) r.opaque_boxes += 1;
        // The extension asks that t is no farther than what is committed.
        bool is_nearer = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT
                             || ray.generated_t < rayQueryGetIntersectionTEXT(query, true);
        if (confirms && is_nearer) rayQueryGenerateIntersectionEXT(query, ray.generated_t);
    }
    if (ray.decision == TERMINATE) rayQueryTerminateEXT(query);
}

void report(uint i) {
    r.t_min = rayQueryGetRayTMinEXT(query);
    r.flags = rayQueryGetRayFlagsEXT(query);
    r.origin = rayQueryGetWorldRayOriginEXT(query);
    r.direction = rayQueryGetWorldRayDirectionEXT(query);
    Meeting m = Meeting(rayQueryGetIntersectionTypeEXT(query, true), 0.0, 0, 0, 0, 0, 0, 0, vec2(0), vec3(0), vec3(0), mat4x3(0), mat4x3(0));
    if (m.type != gl_RayQueryCommittedIntersectionNoneEXT) {
        m.t = rayQueryGetIntersectionTEXT(query, true);
        m.instance = rayQueryGetIntersectionInstanceIdEXT(query, true);
        m.custom_index = rayQueryGetIntersectionInstanceCustomIndexEXT(query, true);
        m.offset = rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, true);
        m.geometry = rayQueryGetIntersectionGeometryIndexEXT(query, true);
        m.primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        m.object_origin = rayQueryGetIntersectionObjectRayOriginEXT(query, true);
        m.object_direction = rayQueryGetIntersectionObjectRayDirectionEXT(query, true);
        m.object_to_world = rayQueryGetIntersectionObjectToWorldEXT(query, true);
        m.world_to_object = rayQueryGetIntersectionWorldToObjectEXT(query, true);
        if (m.type == gl_RayQueryCommittedIntersectionTriangleEXT) {
            m.is_front = rayQueryGetIntersectionFrontFaceEXT(query, true) ? 1 : 0;
            m.barycentrics = rayQueryGetIntersectionBarycentricsEXT(query, true);
        }
    }
    r.committed = m;
    reports.report[i] = r;
}

#ifdef IN_TURN
#include "trace/query_turns.glsl"
const uint RAYS_EACH = 5;

void main() {
    uint begins = gl_WorkGroupID.x * gl_WorkGroupSize.x * RAYS_EACH;
    uint next = begins + gl_LocalInvocationIndex;
    uint end = min(count, begins + gl_WorkGroupSize.x * RAYS_EACH);
    uint i = next;
    HedgerowTurns turns = hedgerowTurns(accelerationStructureEXT(told));
    while (hedgerowTakeTurn(turns, next < end)) {
        if (turns.takes) {
            i = next;
            next += gl_WorkGroupSize.x;
            begin(i);
        }
        if (hedgerowRayQueryProceedInTurn(query, turns, ray.flags)) decide();
        if (hedgerowRayQueryEndsInTurn(query, turns)) report(i);
    }
}
#else
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    begin(i);
    for (uint round = 0; round < 10000 && rayQueryProceedEXT(query); ++round) {
        decide();
#ifdef WITH_ANOTHER
        if (rayQueryProceedEXT(another)) rayQueryConfirmIntersectionEXT(another);
        r.opaque_boxes += rayQueryGetIntersectionTypeEXT(another, true);
#endif
    }
    report(i);
}
#endif
