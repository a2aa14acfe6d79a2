// Each ray through a kd-tree and through a BVH of the same triangles, by the headers that engines include, both in one shader.
//
// Its own names are those of the library's layouts: none of them may leave the headers.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require
#define HEDGEROW_KD_CAPACITY 3
#define HEDGEROW_KD_PUSH_DOWN true
#include "gpu/division.glsl"
#include "trace/query.glsl"
#include "trace/kd_tree.glsl"

layout(local_size_x = 64) in;

struct Node {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

struct Triangle {
    float t;
    uint primitive;
    vec2 weights;
};

struct KdNode {
    Triangle of_kd_tree;
    Triangle of_query;
    uint is_hit;
    HedgerowGeometry geometry;
};

layout(buffer_reference, scalar) readonly buffer Structure { Node ray[]; };
layout(buffer_reference, scalar) writeonly buffer KdStructure { KdNode report[]; };
layout(push_constant, scalar) uniform KdProbeArguments { uvec2 kd_tree; uvec2 bvh; Structure rays; KdStructure reports; uint count; };

Triangle hit_nearer(Node ray) {
    HedgerowRayQuery query;
    hedgerowRayQueryInitialize(query, hedgerowAccelerationStructure(bvh), hedgerowRayFlagsOpaque, 0xff, ray.origin, ray.t_min,
                               ray.direction, ray.t_max);
    while (hedgerowRayQueryProceed(query)) {}
    if (hedgerowRayQueryGetIntersectionType(query, true) == hedgerowRayQueryCommittedIntersectionNone) {
        return Triangle(HEDGEROW_INFINITY, HEDGEROW_NONE, vec2(0.0));
    }
    return Triangle(hedgerowRayQueryGetIntersectionT(query, true), hedgerowRayQueryGetIntersectionPrimitiveIndex(query, true),
                    hedgerowRayQueryGetIntersectionBarycentrics(query, true));
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    Node ray = rays.ray[i];
    HedgerowHit hit = hedgerowKdTreeClosestHit(kd_tree, ray.origin, ray.t_min, ray.direction, ray.t_max);
    KdNode report;
    report.of_kd_tree = Triangle(hit.t, hit.primitive, vec2(hit.u, hit.v));
    report.of_query = hit_nearer(ray);
    report.is_hit = uint(hedgerowKdTreeAnyHit(kd_tree, ray.origin, ray.t_min, ray.direction, ray.t_max));
    report.geometry = HedgerowGeometry(0u, 0u, 0u);
    if (hit.primitive != HEDGEROW_NONE) report.geometry = hedgerowKdTreeGeometry(kd_tree, hit.primitive);
    reports.report[i] = report;
}
