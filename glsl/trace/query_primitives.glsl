// What a query does at a primitive: the flags of the ray, its instance and its geometry, and whether a meeting is a hit or a candidate. A
// part of trace/query_walk.glsl.
#ifndef HEDGEROW_TRACE_QUERY_PRIMITIVES
#define HEDGEROW_TRACE_QUERY_PRIMITIVES
// Whether a meeting with the geometry of the primitive is a hit without asking.
bool hedgerow_is_opaque(HedgerowRayQuery query, uint primitive) {
    bool is_opaque = (query.form & FORM_ALL_OPAQUE) != 0u;
    if (!is_opaque && (query.form & FORM_ANY_OPAQUE) != 0u) {
        is_opaque = (hedgerow_geometry_of(query.structure, query.slots, primitive).flags & GEOMETRY_OPAQUE) != 0u;
    }
    if ((query.instance_flags & HEDGEROW_INSTANCE_FORCE_OPAQUE) != 0u) is_opaque = true;
    if ((query.instance_flags & HEDGEROW_INSTANCE_FORCE_NO_OPAQUE) != 0u) is_opaque = false;
    if ((query.flags & hedgerowRayFlagsOpaque) != 0u) is_opaque = true;
    if ((query.flags & hedgerowRayFlagsNoOpaque) != 0u) is_opaque = false;
    return is_opaque;
}

bool hedgerow_is_culled(HedgerowRayQuery query, bool is_opaque) {
    return (query.flags & (is_opaque ? hedgerowRayFlagsCullOpaque : hedgerowRayFlagsCullNoOpaque)) != 0u;
}

// The triangle of the record `at`; true if it is a candidate that the shader must decide on.
bool hedgerow_meet_triangle(inout HedgerowRayQuery query, Triangle triangle, uint at) {
    vec3 met;
    bool is_front;
    if (!hedgerow_meet_facing(query.prepared, triangle.v0, triangle.v1, triangle.v2, met, is_front)) return false;
    if (!(query.ray.t_min < met.x && met.x < query.ray.t_max && met.x <= query.best)) return false;
    is_front = is_front != ((query.instance_flags & HEDGEROW_INSTANCE_FLIP_FACING) != 0u);
    uint culled = is_front ? hedgerowRayFlagsCullFrontFacingTriangles : hedgerowRayFlagsCullBackFacingTriangles;
    if ((query.flags & culled) != 0u && (query.instance_flags & HEDGEROW_INSTANCE_CULL_DISABLE) == 0u) return false;
    bool is_opaque = hedgerow_is_opaque(query, triangle.primitive);
    if (hedgerow_is_culled(query, is_opaque)) return false;
#ifdef HEDGEROW_LANES
    uint primitive = 0u;
#else
    uint primitive = triangle.primitive;
#endif
    query.candidate =
        HedgerowMeeting(HEDGEROW_MET_TRIANGLE, met.x, met.y, met.z, at, primitive, query.instance, is_front, is_opaque);
    if (met.x == query.best && !hedgerow_comes_before(query)) return false;
    if (is_opaque) hedgerow_commit(query);
    return !is_opaque;
}

// The same for a box: always a candidate, as only the shader knows what is in it.
bool hedgerow_test_box(inout HedgerowRayQuery query, uint at) {
    BoxRecord box = BoxRecords(hedgerow_records_in(query.structure, query.slots, query.form)).box[at];
    // Inside out where an update has left it out.
    if (box.lo.x > box.hi.x) return false;
    bool entered;
    hedgerow_enter(query.prepared, box.lo, box.hi, query.best, entered);
    if (!entered) return false;
    bool is_opaque = hedgerow_is_opaque(query, box.primitive);
    if (hedgerow_is_culled(query, is_opaque)) return false;
    query.candidate = HedgerowMeeting(HEDGEROW_MET_BOX, query.best, 0.0, 0.0, at, box.primitive, query.instance, false, is_opaque);
    return true;
}

#include "trace/query_pairs.glsl"

// The next record of the leaf; true if what was met is a candidate that the shader must decide on.
bool hedgerow_test(inout HedgerowRayQuery query) {
    if (hedgerow_is_quantised(query) && (query.form & FORM_BOXES) == 0u) return hedgerow_test_pair(query);
    uint at = query.index;
    hedgerow_step(query);
    HEDGEROW_COUNT(w);
    if (at >= query.records) return false;
    if ((query.form & FORM_BOXES) != 0u) return hedgerow_test_box(query, at);
    Triangle triangle = hedgerow_triangle_at(hedgerow_records_in(query.structure, query.slots, query.form), at);
    return hedgerow_meet_triangle(query, triangle, at);
}
#endif
