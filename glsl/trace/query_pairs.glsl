// Triangles of quantised structures, two of which may be one record (bvh/wide/pairs.glsl): a part of trace/query_walk.glsl, which declares
// the query.
//
// A record is named by the unit where it begins, and its second triangle by that and a bit.
#ifndef HEDGEROW_TRACE_QUERY_PAIRS
#define HEDGEROW_TRACE_QUERY_PAIRS

// One or both triangles of the next record; true if one is a candidate that the shader must decide on. After that of the first, the
// second is next.
bool hedgerow_test_pair(inout HedgerowRayQuery query) {
    uint at = query.index, unit = at & ~HEDGEROW_SECOND;
    uvec2 records = hedgerow_records_in(query.structure, query.slots, query.form);
    HEDGEROW_COUNT(w);
    // A stale structure may name records that there are not.
    if (unit + UNITS_OF_ONE > UNITS_OF_ONE * query.records) {
        query.left = HEDGEROW_NOTHING;
        return false;
    }
    Triangle first = hedgerow_triangle_at_unit(records, unit);
    uint units = units_of_record(first);
    bool is_pair = has_second(first) && unit + units <= UNITS_OF_ONE * query.records;
    uint left = query.left;
    query.index = unit + units;
    query.left = left <= units ? HEDGEROW_NOTHING : left - units;
    if (at == unit) {
        bool is_candidate = hedgerow_meet_triangle(query, first_of_pair(first), at);
        if (is_candidate && is_pair) {
            query.index = unit | HEDGEROW_SECOND;
            query.left = left;
        }
        bool has_ended = hedgerow_ends_at_first_hit(query) && query.committed.type != HEDGEROW_MET_NOTHING;
        if (is_candidate || !is_pair || has_ended) return is_candidate;
        HEDGEROW_COUNT(w);
    }
    Triangle second = second_of_pair(first, hedgerow_second_of_pair_at(records, unit));
    return hedgerow_meet_triangle(query, second, unit | HEDGEROW_SECOND);
}
#endif
