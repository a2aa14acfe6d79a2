// The header that engines include: rays traced through our structures from any shader, as GLSL_EXT_ray_query does it, by our
// names.
//
//     #include "trace/query.glsl"                              // with glsl/ of this package as the include folder
//
//     HedgerowRayQuery query;
//     hedgerowRayQueryInitialize(query, hedgerowAccelerationStructure(address), hedgerowRayFlagsOpaque, 0xff,
//                                origin, t_min, direction, t_max);
//     while (hedgerowRayQueryProceed(query)) { … }             // candidates that the shader decides on
//     if (hedgerowRayQueryGetIntersectionType(query, true) == hedgerowRayQueryCommittedIntersectionTriangle)
//         t = hedgerowRayQueryGetIntersectionT(query, true);
//
// A shader of GLSL_EXT_ray_query is moved over by renaming: `rayQuery…EXT` to `hedgerowRayQuery…`, `gl_Ray…EXT` to
// `hedgerowRay…`, `accelerationStructureEXT` to `hedgerowAccelerationStructure`; or by trace/ray_query_names.glsl, which does
// it for a shader that compiles for both. What a query is asked before it has proceeded, or of a hit that there is not, is as
// undefined as in the extension, but bounded: nothing is read outside the structures.
//
// Beyond the extension: a bottom-level structure can be queried itself, as if it were the one instance, without a transform,
// of a top level (instance id and custom index 0).
//
// reads   the structures: the caller places a barrier behind their builds (shader write -> shader read)
// needs   the features of gpu::requirements(); no descriptors, no shared memory (but see trace/stack.glsl), any subgroup size
//
// An invocation has one query at a time, unless the shader defines HEDGEROW_QUERIES, the number of those that live at the same
// time, before it includes this file, and begins the others with `hedgerowRayQueryInitializeAt(query, n, …)`, n from 1 on.
//
// A triangle is hit when t_min < t < t_max; of equally near ones that of the lower instance, then of the lower primitive. A box
// is a candidate where the ray is in it anywhere from t_min to t_max, both included. A walk ends for every input: rays that are
// no rays (NaN, infinite, no direction) hit nothing, and so does what is empty or cannot be used by its status
// (src/bvh/layout.rs).
#ifndef HEDGEROW_TRACE_QUERY
#define HEDGEROW_TRACE_QUERY

// Names that are the includer's: until the end of this file.
#include "bvh/names.glsl"
#ifndef HEDGEROW_QUERIES
#define HEDGEROW_QUERIES 1
#endif
#include "trace/query_walk.glsl"

#define hedgerowAccelerationStructure HedgerowStructure

const uint hedgerowRayQueryCandidateIntersectionTriangle = HEDGEROW_MET_TRIANGLE - 1u;
const uint hedgerowRayQueryCandidateIntersectionAABB = HEDGEROW_MET_BOX - 1u;
const uint hedgerowRayQueryCommittedIntersectionNone = HEDGEROW_MET_NOTHING;
const uint hedgerowRayQueryCommittedIntersectionTriangle = HEDGEROW_MET_TRIANGLE;
const uint hedgerowRayQueryCommittedIntersectionGenerated = HEDGEROW_MET_BOX;

void hedgerowRayQueryInitializeAt(out HedgerowRayQuery query, uint slot, HedgerowStructure structure, uint flags,
                                  uint cull_mask, vec3 origin, float t_min, vec3 direction, float t_max) {
    hedgerow_begin(query, slot, uvec2(structure), flags, cull_mask & 0xffu, HedgerowRay(origin, t_min, direction, t_max));
}

void hedgerowRayQueryInitialize(out HedgerowRayQuery query, HedgerowStructure structure, uint flags, uint cull_mask,
                                vec3 origin, float t_min, vec3 direction, float t_max) {
    hedgerowRayQueryInitializeAt(query, 0u, structure, flags, cull_mask, origin, t_min, direction, t_max);
}

// True while a candidate waits to be decided on: a triangle that is not opaque, or a box.
bool hedgerowRayQueryProceed(inout HedgerowRayQuery query) {
    return hedgerow_proceed(query);
}

void hedgerowRayQueryTerminate(inout HedgerowRayQuery query) {
    hedgerow_end(query);
}

// The candidate triangle is a hit.
void hedgerowRayQueryConfirmIntersection(inout HedgerowRayQuery query) {
    hedgerow_commit(query);
}

// The candidate box is hit at t.
void hedgerowRayQueryGenerateIntersection(inout HedgerowRayQuery query, float t) {
    query.candidate.t = t;
    hedgerow_commit(query);
}

uint hedgerowRayQueryGetIntersectionType(HedgerowRayQuery query, bool committed) {
    return committed ? query.committed.type : query.candidate.type - 1u;
}

float hedgerowRayQueryGetIntersectionT(HedgerowRayQuery query, bool committed) {
    return hedgerow_met(query, committed).t;
}

// The 24 bits of the instance.
uint hedgerowRayQueryGetIntersectionInstanceCustomIndex(HedgerowRayQuery query, bool committed) {
    return hedgerow_instance_of(query, hedgerow_met(query, committed)).index_and_mask & 0xffffffu;
}

// The instance's position in the input.
uint hedgerowRayQueryGetIntersectionInstanceId(HedgerowRayQuery query, bool committed) {
    return hedgerow_instance_of(query, hedgerow_met(query, committed)).instance;
}

uint hedgerowRayQueryGetIntersectionInstanceShaderBindingTableRecordOffset(HedgerowRayQuery query, bool committed) {
    return hedgerow_instance_of(query, hedgerow_met(query, committed)).offset_and_flags & 0xffffffu;
}

uint hedgerowRayQueryGetIntersectionGeometryIndex(HedgerowRayQuery query, bool committed) {
    return hedgerow_geometry_met(query, hedgerow_met(query, committed)).x;
}

// The primitive's position in its geometry.
uint hedgerowRayQueryGetIntersectionPrimitiveIndex(HedgerowRayQuery query, bool committed) {
    HedgerowMeeting met = hedgerow_met(query, committed);
    return met.primitive - hedgerow_geometry_met(query, met).y;
}

// The weights of the second and the third vertex.
vec2 hedgerowRayQueryGetIntersectionBarycentrics(HedgerowRayQuery query, bool committed) {
    HedgerowMeeting met = hedgerow_met(query, committed);
    return vec2(met.u, met.v);
}

bool hedgerowRayQueryGetIntersectionFrontFace(HedgerowRayQuery query, bool committed) {
    return hedgerow_met(query, committed).is_front != 0u;
}

bool hedgerowRayQueryGetIntersectionCandidateAABBOpaque(HedgerowRayQuery query) {
    return query.candidate.is_opaque != 0u;
}

vec3 hedgerowRayQueryGetIntersectionObjectRayDirection(HedgerowRayQuery query, bool committed) {
    vec4 to_object[3] = hedgerow_instance_of(query, hedgerow_met(query, committed)).to_object;
    return hedgerow_transformed(to_object, vec4(query.ray.direction, 0.0));
}

vec3 hedgerowRayQueryGetIntersectionObjectRayOrigin(HedgerowRayQuery query, bool committed) {
    vec4 to_object[3] = hedgerow_instance_of(query, hedgerow_met(query, committed)).to_object;
    return hedgerow_transformed(to_object, vec4(query.ray.origin, 1.0));
}

mat4x3 hedgerowRayQueryGetIntersectionObjectToWorld(HedgerowRayQuery query, bool committed) {
    vec4 rows[3] = hedgerow_instance_of(query, hedgerow_met(query, committed)).to_world;
    return transpose(mat3x4(rows[0], rows[1], rows[2]));
}

mat4x3 hedgerowRayQueryGetIntersectionWorldToObject(HedgerowRayQuery query, bool committed) {
    vec4 rows[3] = hedgerow_instance_of(query, hedgerow_met(query, committed)).to_object;
    return transpose(mat3x4(rows[0], rows[1], rows[2]));
}

// The corners of the triangle, in the object's space.
void hedgerowRayQueryGetIntersectionTriangleVertexPositions(HedgerowRayQuery query, bool committed, out vec3 positions[3]) {
    HedgerowMeeting met = hedgerow_met(query, committed);
    HedgerowTriangle triangle = hedgerow_triangle_of(hedgerow_instance_of(query, met), met);
    positions = vec3[3](triangle.v0, triangle.v1, triangle.v2);
}

float hedgerowRayQueryGetRayTMin(HedgerowRayQuery query) {
    return query.ray.t_min;
}

uint hedgerowRayQueryGetRayFlags(HedgerowRayQuery query) {
    return query.flags;
}

vec3 hedgerowRayQueryGetWorldRayOrigin(HedgerowRayQuery query) {
    return query.ray.origin;
}

vec3 hedgerowRayQueryGetWorldRayDirection(HedgerowRayQuery query) {
    return query.ray.direction;
}

#include "bvh/names_end.glsl"
#endif
