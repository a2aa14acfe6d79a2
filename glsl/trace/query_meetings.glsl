// What a query has met: the instance, triangle, primitive and geometry of a meeting, and which of two counts: a part of trace/query_walk.glsl,
// which declares the query.
#ifndef HEDGEROW_TRACE_QUERY_MEETINGS
#define HEDGEROW_TRACE_QUERY_MEETINGS

// The geometry of a primitive of a structure with so many nodes, as whoever asks knows it. Where something else lies there by now, the
// first: its header may name any place.
HedgerowGeometry hedgerow_geometry_of(uvec2 structure, uint slots, uint primitive) {
    Header header = Structure(structure).header;
    HedgerowGeometry geometry = HedgerowGeometry(0u, 0u, header.geometry_flags);
    // First, as it is most often all that has to be loaded.
    if (header.geometry_count > 1u) {
        geometry.flags = 0u;
        if (header.magic == MAGIC && header.node_slots == slots) {
            geometry = hedgerow_geometry_in(GeometryTable(geometry_table_of(structure, header)), header.geometry_count, primitive);
        }
    }
    return geometry;
}

HedgerowMeeting hedgerow_met(HedgerowRayQuery query, bool committed) {
    HedgerowMeeting met = query.candidate;
    if (committed) met = query.committed;
    return met;
}

// The records of a structure.
uvec2 hedgerow_records_in(uvec2 structure, uint slots, uint form) {
    uvec2 records;
    if ((form & FORM_QUANTISED) != 0u) records = wide_records_at(structure, slots, QUANTISED_NODE_BYTES);
    else records = records_at(structure, slots);
    return records;
}

uvec2 hedgerow_records_of_top(HedgerowRayQuery query) {
    return hedgerow_records_in(query.top, query.top_slots, query.top_form);
}

// The instance of a meeting: of a bottom-level structure that is queried itself, one without a transform.
Instance hedgerow_instance_of(HedgerowRayQuery query, HedgerowMeeting met) {
    const vec4 identity[3] = vec4[3](vec4(1, 0, 0, 0), vec4(0, 1, 0, 0), vec4(0, 0, 1, 0));
    Instance instance = Instance(identity, identity, query.top, 0u, 0u, 0u, 0u, query.top_slots | query.top_form, query.top_records);
    if (hedgerow_has_top(query)) instance = Instances(hedgerow_records_of_top(query)).instance[met.instance];
    return instance;
}

// How many geometries a bottom-level structure has that is queried itself. With HEDGEROW_LANES it is the one that turns were told of
// (trace/query_turns.glsl), the same for all lanes: loaded again, it is no number that each lane keeps through all rounds.
uint hedgerow_geometries_of_top(HedgerowRayQuery query) {
    uint count = query.top_geometries;
#ifdef HEDGEROW_LANES
    if (HEDGEROW_ONE_LEVEL && HEDGEROW_ALL_BUILT) count = Structure(query.top).header.geometry_count;
#endif
    return count;
}

// The index of a meeting's geometry, and its first primitive. Where a bottom-level structure of one geometry is queried itself, nothing is loaded.
uvec2 hedgerow_geometry_met(HedgerowRayQuery query, HedgerowMeeting met) {
    uvec2 index_and_first = uvec2(0u);
    if (hedgerow_has_top(query) || hedgerow_geometries_of_top(query) > 1u) {
        Instance instance = hedgerow_instance_of(query, met);
        HedgerowGeometry geometry = hedgerow_geometry_of(instance.structure, instance.slots & INDEX_MASK, met.primitive);
        index_and_first = uvec2(geometry.index, geometry.first);
    }
    return index_and_first;
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
    bool is_met = b.type != HEDGEROW_MET_NOTHING;
    uint of_a = 0u, of_b = 0u;
    if (hedgerow_has_top(query) && is_met && a.t == b.t) {
        of_a = hedgerow_instance_of(query, a).instance;
        of_b = hedgerow_instance_of(query, b).instance;
    }
    bool comes_before = of_a < of_b || (of_a == of_b && a.primitive < b.primitive);
    return is_met && comes_before;
}

void hedgerow_commit(inout HedgerowRayQuery query) {
    query.committed = query.candidate;
#ifdef HEDGEROW_LINK_COUNTS
    query.hit_at = query.at;
#endif
    if (hedgerow_ends_at_first_hit(query)) {
        hedgerow_count_hit(query);
        hedgerow_end(query);
    }
}
#endif
