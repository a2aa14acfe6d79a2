// What a query has met: the instance, triangle, primitive and geometry of a meeting, and which of two counts: a part of trace/query_walk.glsl,
// which declares the query.
#ifndef HEDGEROW_TRACE_QUERY_MEETINGS
#define HEDGEROW_TRACE_QUERY_MEETINGS

// The geometry of a primitive of a structure with so many nodes, as whoever asks knows it. Where something else lies there by now, the
// first: its header may name any place.
HedgerowGeometry hedgerow_geometry_of(uvec2 structure, uint slots, uint primitive) {
    Header header = Structure(structure).header;
    // First, as it is most often all that has to be loaded.
    if (header.geometry_count <= 1u) return HedgerowGeometry(0u, 0u, header.geometry_flags);
    if (header.magic != MAGIC || header.node_slots != slots) return HedgerowGeometry(0u, 0u, 0u);
    GeometryTable table = GeometryTable(geometry_table_of(structure, header));
    return hedgerow_geometry_in(table, header.geometry_count, primitive);
}

HedgerowMeeting hedgerow_met(HedgerowRayQuery query, bool committed) {
    HedgerowMeeting met = query.candidate;
    if (committed) met = query.committed;
    return met;
}

// The records of a structure.
uvec2 hedgerow_records_in(uvec2 structure, uint slots, uint form) {
    if ((form & FORM_QUANTISED) != 0u) return wide_records_at(structure, slots, QUANTISED_NODE_BYTES);
    return records_at(structure, slots);
}

uvec2 hedgerow_records_of_top(HedgerowRayQuery query) {
    return hedgerow_records_in(query.top, query.top_slots, query.top_form);
}

// The instance of a meeting: of a bottom-level structure that is queried itself, one without a transform.
Instance hedgerow_instance_of(HedgerowRayQuery query, HedgerowMeeting met) {
    if (hedgerow_has_top(query)) return Instances(hedgerow_records_of_top(query)).instance[met.instance];
    const vec4 identity[3] = vec4[3](vec4(1, 0, 0, 0), vec4(0, 1, 0, 0), vec4(0, 0, 1, 0));
    return Instance(identity, identity, query.top, 0u, 0u, 0u, 0u, query.top_slots | query.top_form, query.top_records);
}

uvec2 hedgerow_records_of(Instance instance) {
    return hedgerow_records_in(instance.structure, instance.slots & INDEX_MASK, instance.slots);
}

// The triangle that a meeting was with.
Triangle hedgerow_triangle_of(Instance instance, HedgerowMeeting met) {
    uvec2 records = hedgerow_records_of(instance);
    if ((instance.slots & FORM_QUANTISED) != 0u) return hedgerow_triangle_of_record(records, met.record);
    return Triangles(records).triangle[met.record];
}

// Whether the candidate comes before the committed hit at the same t: by instance, then primitive. Several records may be of one instance.
bool hedgerow_comes_before(HedgerowRayQuery query) {
    HedgerowMeeting a = query.candidate, b = query.committed;
    if (b.type == HEDGEROW_MET_NOTHING) return false;
    Instance of_a = hedgerow_instance_of(query, a), of_b = hedgerow_instance_of(query, b);
    if (of_a.instance != of_b.instance) return of_a.instance < of_b.instance;
    return a.primitive < b.primitive;
}

void hedgerow_commit(inout HedgerowRayQuery query) {
    query.committed = query.candidate;
    query.best = query.candidate.t;
#ifdef HEDGEROW_LINK_COUNTS
    query.hit_at = query.at;
#endif
    if (hedgerow_ends_at_first_hit(query)) {
        hedgerow_count_hit(query);
        hedgerow_end(query);
    }
}
#endif
