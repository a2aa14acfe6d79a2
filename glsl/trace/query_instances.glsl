// The steps of a query into an instance and out of it: a part of trace/query_walk.glsl, which declares the query.
#ifndef HEDGEROW_TRACE_QUERY_INSTANCES
#define HEDGEROW_TRACE_QUERY_INSTANCES

// Whether the ray meets anything of an instance, and in its space: there it is made ready for the tests.
bool hedgerow_meets_instance(inout HedgerowRayQuery query, Instance instance, out HedgerowRay ray, out HedgerowPreparedRay prepared) {
    bool is_seen = (instance.index_and_mask >> 24 & query.cull_mask) != 0u && any(notEqual(instance.structure, uvec2(0)));
    if (is_seen) {
        HEDGEROW_COUNT(y);
    }
    bool meets = is_seen && !hedgerow_skips(query.flags, instance.slots) && hedgerow_meets(instance.slots);
    ray = HedgerowRay(hedgerow_transformed(instance.to_object, vec4(query.ray.origin, 1.0)), query.ray.t_min,
                      hedgerow_transformed(instance.to_object, vec4(query.ray.direction, 0.0)), query.ray.t_max);
    bool goes = hedgerow_prepare(ray, prepared);
    return meets && goes;
}

// The structure of an instance is at hand, with the ray in its space.
void hedgerow_begin_instance(inout HedgerowRayQuery query, Instance instance, uint at, HedgerowRay ray, HedgerowPreparedRay prepared) {
    // The rest of the leaf waits.
    if (query.left != HEDGEROW_NOTHING && query.level - query.floor < MAX_DEPTH) {
        if (hedgerow_is_quantised(query)) hedgerow_put_off_rest(query);
        else hedgerow_put_off(query, query.index, query.left, -HEDGEROW_INFINITY);
    }
    query.prepared = prepared;
    query.is_prepared = 1u;
    query.structure = instance.structure;
    query.slots = instance.slots & INDEX_MASK;
    query.form = instance.slots & ~INDEX_MASK;
    query.records = hedgerow_is_quantised(query) ? instance.records & INDEX_MASK : instance.records;
    query.top_rounds = query.rounds;
    query.rounds = hedgerow_rounds(query.slots, query.records);
    query.is_below = 1u;
    query.instance = at;
    query.instance_flags = instance.offset_and_flags >> 24;
    query.bottom = query.level;
#ifdef HEDGEROW_LINK_COUNTS
    query.at = HedgerowLink(HEDGEROW_LINK_COUNTS(instance.structure), HEDGEROW_NO_LINK);
#endif
    uvec2 begin = begin_at(instance.start, instance.slots, instance.records);
    hedgerow_begin_at(query, begin.x, hedgerow_is_quantised(query) ? 0u : begin.y);
    if (hedgerow_is_quantised(query)) hedgerow_begin_quantised(query, ray.direction, begin.y);
}

// From the top level into the next instance, if the ray meets it.
void hedgerow_enter_instance(inout HedgerowRayQuery query) {
    uint at = query.index;
    hedgerow_step(query);
    if (at < query.records) {
        Instance instance = hedgerow_instance_at(hedgerow_records_of_top(query), at);
        HedgerowRay ray;
        HedgerowPreparedRay prepared;
        bool meets = hedgerow_meets_instance(query, instance, ray, prepared);
        if (meets) hedgerow_begin_instance(query, instance, at, ray, prepared);
    }
}

// Back to the top level.
void hedgerow_leave_instance(inout HedgerowRayQuery query) {
    hedgerow_take_top(query);
    if (hedgerow_is_quantised(query)) hedgerow_begin_quantised(query, query.ray.direction, ALL_SLOTS);
    query.is_prepared = 0u;
    query.bottom = query.floor;
    query.rounds = query.top_rounds;
    query.is_below = 0u;
#ifdef HEDGEROW_LINK_COUNTS
    query.at = HedgerowLink(uvec2(0u), HEDGEROW_NO_LINK);
#endif
}
#endif
