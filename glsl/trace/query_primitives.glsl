// What a query does at a primitive: the flags of the ray, its instance and its geometry, and whether a meeting is a hit or a candidate. A
// part of trace/query_walk.glsl.
#ifndef HEDGEROW_TRACE_QUERY_PRIMITIVES
#define HEDGEROW_TRACE_QUERY_PRIMITIVES
// Whether a meeting with the geometry of the primitive is a hit without asking.
bool hedgerow_is_opaque(HedgerowRayQuery query, uint primitive) {
    uint flags = (query.form & FORM_ALL_OPAQUE) != 0u ? GEOMETRY_OPAQUE : 0u;
    if (flags == 0u && (query.form & FORM_ANY_OPAQUE) != 0u) flags = hedgerow_geometry_of(query.structure, query.slots, primitive).flags;
    bool is_opaque = (flags & GEOMETRY_OPAQUE) != 0u;
    if ((query.instance_flags & HEDGEROW_INSTANCE_FORCE_OPAQUE) != 0u) is_opaque = true;
    if ((query.instance_flags & HEDGEROW_INSTANCE_FORCE_NO_OPAQUE) != 0u) is_opaque = false;
    if ((query.flags & hedgerowRayFlagsOpaque) != 0u) is_opaque = true;
    if ((query.flags & hedgerowRayFlagsNoOpaque) != 0u) is_opaque = false;
    return is_opaque;
}

bool hedgerow_is_culled(HedgerowRayQuery query, bool is_opaque) {
    return (query.flags & (is_opaque ? hedgerowRayFlagsCullOpaque : hedgerowRayFlagsCullNoOpaque)) != 0u;
}

// The triangle of the record `at`; 1 if it is a candidate that the shader must decide on.
uint hedgerow_meet_triangle(inout HedgerowRayQuery query, Triangle triangle, uint at) {
    vec3 met;
    bool is_front;
    bool is_met = hedgerow_meet_facing(query.prepared, triangle.v0, triangle.v1, triangle.v2, met, is_front);
    is_met = is_met && query.ray.t_min < met.x && met.x < query.ray.t_max && met.x <= query.committed.t;
    uint waits = 0u;
    if (is_met) {
        is_front = is_front != ((query.instance_flags & HEDGEROW_INSTANCE_FLIP_FACING) != 0u);
        uint facing = is_front ? hedgerowRayFlagsCullFrontFacingTriangles : hedgerowRayFlagsCullBackFacingTriangles;
        bool culls = (query.flags & facing) != 0u && (query.instance_flags & HEDGEROW_INSTANCE_CULL_DISABLE) == 0u;
        bool is_opaque = hedgerow_is_opaque(query, triangle.primitive);
        if (!culls && !hedgerow_is_culled(query, is_opaque)) {
            query.candidate = HedgerowMeeting(HEDGEROW_MET_TRIANGLE, met.x, met.y, met.z, at, triangle.primitive, query.instance,
                                              is_front ? 1u : 0u, is_opaque ? 1u : 0u);
            bool comes_before = hedgerow_comes_before(query);
            bool is_nearest = met.x != query.committed.t || comes_before;
            if (is_nearest && is_opaque) hedgerow_commit(query);
            waits = is_nearest && !is_opaque ? 1u : 0u;
        }
    }
    return waits;
}

// Takes the next record; whether it is there.
bool hedgerow_takes_record(inout HedgerowRayQuery query, out uint at) {
    at = query.index;
    hedgerow_step(query);
    HEDGEROW_COUNT(w);
    return at < query.records;
}

// The next record, a box; 1 if it is met: always a candidate, as only the shader knows what is in it.
uint hedgerow_test_box(inout HedgerowRayQuery query) {
    uint at, waits = 0u;
    if (hedgerow_takes_record(query, at)) {
        BoxRecord box = BoxRecords(hedgerow_records_in(query.structure, query.slots, query.form)).box[at];
        bool entered;
        hedgerow_enter(query.prepared, box.lo, box.hi, query.committed.t, entered);
        // Inside out where an update has left it out.
        if (entered && box.lo.x <= box.hi.x) {
            bool is_opaque = hedgerow_is_opaque(query, box.primitive);
            waits = hedgerow_is_culled(query, is_opaque) ? 0u : 1u;
            if (waits != 0u) {
                query.candidate =
                    HedgerowMeeting(HEDGEROW_MET_BOX, query.committed.t, 0.0, 0.0, at, box.primitive, query.instance, 0u, is_opaque ? 1u : 0u);
            }
        }
    }
    return waits;
}

// The next record, a triangle of a structure of nodes of two.
uint hedgerow_test_triangle(inout HedgerowRayQuery query) {
    uint at, waits = 0u;
    if (hedgerow_takes_record(query, at)) {
        Triangle triangle = hedgerow_triangle_at(records_at(query.structure, query.slots), at);
        waits = hedgerow_meet_triangle(query, triangle, at);
    }
    return waits;
}

#include "trace/query_pairs.glsl"

// The next record of the leaf; 1 if what was met is a candidate that the shader must decide on.
uint hedgerow_test(inout HedgerowRayQuery query) {
    uint waits = 0u;
    if (hedgerow_is_at_boxes(query)) waits = hedgerow_test_box(query);
    else if (hedgerow_is_quantised(query)) waits = hedgerow_test_pair(query);
    else waits = hedgerow_test_triangle(query);
    return waits;
}
#endif
