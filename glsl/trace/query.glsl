// The header that engines include: rays traced through a Bvh2 from any shader, as GLSL_EXT_ray_query does it, by our names.
//
//     #include "trace/query.glsl"                              // with glsl/ of this package as the include folder
//
//     HedgerowRayQuery query;
//     hedgerowRayQueryInitialize(query, hedgerowAccelerationStructure(address), hedgerowRayFlagsOpaque, 0xff,
//                                origin, t_min, direction, t_max);
//     while (hedgerowRayQueryProceed(query)) {}
//     if (hedgerowRayQueryGetIntersectionType(query, true) == hedgerowRayQueryCommittedIntersectionTriangle)
//         t = hedgerowRayQueryGetIntersectionT(query, true);
//
// or, where only the hit is wanted,
//
//     HedgerowHit hit = hedgerow_closest_hit(structure, HedgerowRay(origin, t_min, direction, t_max));
//     bool shadowed = hedgerow_any_hit(structure, HedgerowRay(origin, t_min, direction, t_max));
//
// A shader of GLSL_EXT_ray_query is moved over by renaming: `rayQuery…EXT` to `hedgerowRayQuery…`, `gl_Ray…EXT` to
// `hedgerowRay…`, `accelerationStructureEXT` to `hedgerowAccelerationStructure`. Every triangle is opaque, so that proceeding
// runs to the end and returns false; of a query that has not proceeded, nothing is committed.
//
// reads   the structure: the caller places a barrier behind its build (shader write -> shader read)
// needs   the features of gpu::requirements(); no descriptors, no shared memory (but see trace/stack.glsl), any subgroup size
//
// A hit counts when t_min < t < t_max; of equally near ones that with the lower primitive index. The walk ends for every
// input: rays that are no rays (NaN, infinite, no direction) hit nothing, and so does what is empty or cannot be used by its
// status (src/bvh/layout.rs).
#ifndef HEDGEROW_TRACE_QUERY
#define HEDGEROW_TRACE_QUERY

// The library's own shaders say Node and Triangle; in somebody else's these names are theirs, so they end with this file.
#define Child HedgerowChild
#define Node HedgerowNode
#define Triangle HedgerowTriangle
#define Header HedgerowHeader
#define Structure HedgerowStructure
#define Triangles HedgerowTriangles
#define triangles_of hedgerow_triangles_of
#define triangles_at hedgerow_triangles_at
#define MAGIC HEDGEROW_MAGIC
#define KIND_BVH2 HEDGEROW_KIND_BVH2
#define MAX_DEPTH HEDGEROW_MAX_DEPTH
#define STATUS_NON_FINITE HEDGEROW_STATUS_NON_FINITE
#define STATUS_INDEX_OUT_OF_RANGE HEDGEROW_STATUS_INDEX_OUT_OF_RANGE
#define STATUS_TOO_DEEP HEDGEROW_STATUS_TOO_DEEP
#define STATUS_SPIN_RAN_OUT HEDGEROW_STATUS_SPIN_RAN_OUT
#include "bvh/layout.glsl"
#include "trace/ray.glsl"
#include "trace/slab.glsl"
#include "trace/stack.glsl"
#include "trace/triangle.glsl"

#define hedgerowAccelerationStructure HedgerowStructure

const uint hedgerowRayFlagsNone = 0u;
const uint hedgerowRayFlagsOpaque = 1u;
const uint hedgerowRayFlagsTerminateOnFirstHit = 4u;
const uint hedgerowRayQueryCommittedIntersectionNone = 0u;
const uint hedgerowRayQueryCommittedIntersectionTriangle = 1u;

struct HedgerowRayQuery {
    HedgerowStructure structure;
    HedgerowRay ray;
    uint flags;
    uint cull_mask;
    bool done;
    HedgerowHit committed;
};

// Walks the tree; the nearest hit, or with `first` the first that is met.
HedgerowHit hedgerow_walk(HedgerowStructure structure, HedgerowRay given, bool first) {
    HedgerowHit hit = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
    const uint UNUSABLE = STATUS_TOO_DEEP | STATUS_SPIN_RAN_OUT;
    HedgerowTriangles triangles = triangles_of(structure);
    HedgerowPreparedRay ray;
    bool going = hedgerow_prepare(given, structure.header.root.lo, structure.header.root.hi, ray) &&
                 structure.header.active_count != 0u && (structure.header.status & UNUSABLE) == 0u;
    float best = ray.t_max;
    uint index = structure.header.root.index;
    uint count = structure.header.root.count;
    uint level = 0;
    while (going) {
        bool found = false;
        if (count == 0u) {
            HedgerowNode node = structure.nodes[index];
            bool enters_left, enters_right;
            float left = hedgerow_enter(ray, node.left.lo, node.left.hi, best, enters_left);
            float right = hedgerow_enter(ray, node.right.lo, node.right.hi, best, enters_right);
            bool right_first = enters_right && (!enters_left || right < left);
            if (enters_left && enters_right) {
                hedgerow_put(level, right_first ? HedgerowWaiting(node.left.index, node.left.count, left)
                                                : HedgerowWaiting(node.right.index, node.right.count, right));
                level++;
            }
            found = enters_left || enters_right;
            index = right_first ? node.right.index : node.left.index;
            count = right_first ? node.right.count : node.left.count;
        } else {
            for (uint i = index; i < index + count; i++) {
                HedgerowTriangle triangle = triangles.triangle[i];
                vec3 met;
                if (hedgerow_meet(ray, triangle.v0, triangle.v1, triangle.v2, met) && ray.t_min < met.x &&
                    met.x < ray.t_max && (met.x < best || met.x == best && triangle.primitive < hit.primitive)) {
                    best = met.x;
                    hit = HedgerowHit(met.x, triangle.primitive, met.y, met.z);
                    if (first) break;
                }
            }
            if (first && hit.primitive != HEDGEROW_NONE) break;
        }
        while (!found && level > 0u) {
            level--;
            HedgerowWaiting waiting = hedgerow_taken(level);
            index = waiting.index;
            count = waiting.count;
            // Equally far is not too far: an equally near hit with a lower index may be there.
            found = waiting.enter <= best;
        }
        going = found;
    }
    return hit;
}

// The nearest hit; without one, t is infinite and the primitive 0xffffffff.
HedgerowHit hedgerow_closest_hit(HedgerowStructure structure, HedgerowRay ray) {
    return hedgerow_walk(structure, ray, false);
}

// Whether there is a hit.
bool hedgerow_any_hit(HedgerowStructure structure, HedgerowRay ray) {
    return hedgerow_walk(structure, ray, true).primitive != HEDGEROW_NONE;
}

void hedgerowRayQueryInitialize(out HedgerowRayQuery query, HedgerowStructure structure, uint flags, uint cull_mask,
                                vec3 origin, float t_min, vec3 direction, float t_max) {
    query.structure = structure;
    query.ray = HedgerowRay(origin, t_min, direction, t_max);
    query.flags = flags;
    query.cull_mask = cull_mask;
    query.done = false;
    query.committed = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
}

// True while a candidate waits to be decided on: never, as every triangle is opaque.
bool hedgerowRayQueryProceed(inout HedgerowRayQuery query) {
    // As in Vulkan, a mask without bits lets the ray meet nothing.
    if (!query.done && (query.cull_mask & 0xffu) != 0u) {
        bool first = (query.flags & hedgerowRayFlagsTerminateOnFirstHit) != 0u;
        query.committed = hedgerow_walk(query.structure, query.ray, first);
    }
    query.done = true;
    return false;
}

void hedgerowRayQueryTerminate(inout HedgerowRayQuery query) {
    query.done = true;
}

// The getters take `committed` for the sake of the names; there are no candidates to ask for.
uint hedgerowRayQueryGetIntersectionType(HedgerowRayQuery query, bool committed) {
    return committed && query.committed.primitive != HEDGEROW_NONE ? hedgerowRayQueryCommittedIntersectionTriangle
                                                                  : hedgerowRayQueryCommittedIntersectionNone;
}

float hedgerowRayQueryGetIntersectionT(HedgerowRayQuery query, bool committed) {
    return query.committed.t;
}

uint hedgerowRayQueryGetIntersectionPrimitiveIndex(HedgerowRayQuery query, bool committed) {
    return query.committed.primitive;
}

vec2 hedgerowRayQueryGetIntersectionBarycentrics(HedgerowRayQuery query, bool committed) {
    return vec2(query.committed.u, query.committed.v);
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

#undef Child
#undef Node
#undef Triangle
#undef Header
#undef Structure
#undef Triangles
#undef triangles_of
#undef triangles_at
#undef MAGIC
#undef KIND_BVH2
#undef MAX_DEPTH
#undef STATUS_NON_FINITE
#undef STATUS_INDEX_OUT_OF_RANGE
#undef STATUS_TOO_DEEP
#undef STATUS_SPIN_RAN_OUT
#endif
