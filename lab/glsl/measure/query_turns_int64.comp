// The same as measure/query_int64.comp, with many rays for each invocation, in turn (trace/query_turns.glsl).
#version 460
layout(local_size_x_id = 0) in;
layout(constant_id = 2) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
layout(constant_id = 5) const bool ONE_LEVEL = false;
#define HEDGEROW_ONE_LEVEL ONE_LEVEL
layout(constant_id = 6) const uint FORMS = 3;
#define HEDGEROW_FORMS FORMS
#define HEDGEROW_ALL_BUILT true
layout(constant_id = 7) const bool LONG_NODES = false;
#define HEDGEROW_INT64
#define HEDGEROW_LONG_NODES LONG_NODES
#define IN_TURN
#include "gpu/division.glsl"
#include "trace/ray_query_names.glsl"
#include "measure/ray_query.glsl"
