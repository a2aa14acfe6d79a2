// Triangles of quantised structures, two of which may be one record (bvh/wide/pairs.glsl): a part of trace/query_walk.glsl, which declares
// the query.
//
// A record is named by the unit where it begins, and its second triangle by that and a bit.
#ifndef HEDGEROW_TRACE_QUERY_PAIRS
#define HEDGEROW_TRACE_QUERY_PAIRS

uint hedgerow_unit_of(HedgerowRayQuery query) {
    return query.index & ~HEDGEROW_SECOND;
}

// Whether the next record is there: a stale structure may name records that there are not.
bool hedgerow_comes_to_record(inout HedgerowRayQuery query) {
    bool is_there = hedgerow_unit_of(query) + UNITS_OF_ONE <= UNITS_OF_ONE * query.records;
    if (!is_there) query.left = HEDGEROW_NOTHING;
    return is_there;
}

// Whether the next record, whose first triangle this is, has a second one, and that is there.
bool hedgerow_is_pair(HedgerowRayQuery query, Triangle first) {
    return has_second(first) && hedgerow_unit_of(query) + UNITS_OF_TWO <= UNITS_OF_ONE * query.records;
}

// One or both triangles of the next record, as they lie in memory; 1 if one is a candidate that the shader must decide on. After that of
// the first, the second is next.
uint hedgerow_meet_pair(inout HedgerowRayQuery query, Triangle first, SecondOfPair second, bool is_pair) {
    uint at = query.index, unit = hedgerow_unit_of(query), left = query.left, units = units_of_record(first);
    HEDGEROW_COUNT(w);
    query.index = unit + units;
    query.left = left <= units ? HEDGEROW_NOTHING : left - units;
    uint waits = 0u;
    // Nothing was decided on between the two where all are opaque.
    bool is_first = (query.flags & hedgerowRayFlagsOpaque) != 0u || at == unit;
    if (is_first) waits = hedgerow_meet_triangle(query, first_of_pair(first), at);
    if (waits != 0u && is_pair) {
        query.index = unit | HEDGEROW_SECOND;
        query.left = left;
    }
    bool has_ended = hedgerow_ends_at_first_hit(query) && query.committed.type != HEDGEROW_MET_NOTHING;
    if (is_pair && waits == 0u && !has_ended) {
        if (is_first) HEDGEROW_COUNT(w);
        waits = hedgerow_meet_triangle(query, second_of_pair(first, second), unit | HEDGEROW_SECOND);
    }
    return waits;
}

uint hedgerow_test_pair(inout HedgerowRayQuery query) {
    uint waits = 0u;
    if (hedgerow_comes_to_record(query)) {
        uvec2 records = wide_records_at(query.structure, query.slots, QUANTISED_NODE_BYTES);
        Triangle first = hedgerow_triangle_at_unit(records, hedgerow_unit_of(query));
        SecondOfPair second = SecondOfPair(vec3(0.0), 0u);
        bool is_pair = hedgerow_is_pair(query, first);
        if (is_pair) second = hedgerow_second_of_pair_at(records, hedgerow_unit_of(query));
        waits = hedgerow_meet_pair(query, first, second, is_pair);
    }
    return waits;
}
#endif
