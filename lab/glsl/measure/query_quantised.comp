// The same as measure/query.comp, meeting nodes of eight, too: a module of its own, as what nobody uses costs (trace/query_walk.glsl).
#version 460
layout(local_size_x_id = 0) in;
layout(constant_id = 2) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
#define HEDGEROW_QUANTISED
#include "trace/ray_query_names.glsl"
#include "measure/ray_query.glsl"
