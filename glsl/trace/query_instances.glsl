// The steps of a query into an instance and out of it: a part of trace/query_walk.glsl, which declares the query.
#ifndef HEDGEROW_TRACE_QUERY_INSTANCES
#define HEDGEROW_TRACE_QUERY_INSTANCES

// From the top level into an instance.
void hedgerow_enter_instance(inout HedgerowRayQuery query) {
    uint at = query.index;
    hedgerow_step(query);
    if (at >= query.records) return;
    Instance instance = hedgerow_instance_at(hedgerow_records_of_top(query), at);
    uint flags = instance.offset_and_flags >> 24;
    if ((instance.index_and_mask >> 24 & query.cull_mask) == 0u || all(equal(instance.structure, uvec2(0)))) return;
    HEDGEROW_COUNT(y);
    if (hedgerow_skips(query.flags, instance.slots) || !hedgerow_meets(instance.slots)) return;
    HedgerowRay ray = HedgerowRay(hedgerow_transformed(instance.to_object, vec4(query.ray.origin, 1.0)), query.ray.t_min,
                                  hedgerow_transformed(instance.to_object, vec4(query.ray.direction, 0.0)), query.ray.t_max);
    HedgerowPreparedRay prepared;
    if (!hedgerow_prepare(ray, prepared)) return;
    // The rest of the leaf waits.
    if (query.left != HEDGEROW_NOTHING && query.level - query.floor < MAX_DEPTH) {
        if (hedgerow_is_quantised(query)) hedgerow_put_off_rest(query);
        else hedgerow_put_off(query, query.index, query.left, -HEDGEROW_INFINITY);
    }
    query.prepared = prepared;
    query.is_prepared = true;
    query.structure = instance.structure;
    query.has_instances = false;
    query.slots = instance.slots & INDEX_MASK;
    query.form = instance.slots & ~INDEX_MASK;
    query.records = hedgerow_is_quantised(query) ? instance.records & INDEX_MASK : instance.records;
    query.top_rounds = query.rounds;
    query.rounds = hedgerow_rounds(query.slots, query.records);
    query.is_below = true;
    query.instance = at;
    query.instance_flags = flags;
    query.bottom = query.level;
#ifdef HEDGEROW_LINK_COUNTS
    query.at = HedgerowLink(HEDGEROW_LINK_COUNTS(instance.structure), HEDGEROW_NO_LINK);
#endif
    uvec2 begin = begin_at(instance.start, instance.slots, instance.records);
    query.index = begin.x;
    query.left = begin.y;
    if (hedgerow_is_quantised(query)) {
        query.left = 0u;
        hedgerow_begin_quantised(query, ray.direction, begin.y);
    }
}

// Back to the top level.
void hedgerow_leave_instance(inout HedgerowRayQuery query) {
    hedgerow_take_top(query);
    if (hedgerow_is_quantised(query)) hedgerow_begin_quantised(query, query.ray.direction, ALL_SLOTS);
    query.is_prepared = false;
    query.bottom = query.floor;
    query.rounds = query.top_rounds;
    query.is_below = false;
#ifdef HEDGEROW_LINK_COUNTS
    query.at = HedgerowLink(uvec2(0u), HEDGEROW_NO_LINK);
#endif
}
#endif
