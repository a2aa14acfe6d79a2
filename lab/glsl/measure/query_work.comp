// The same as measure/query.comp, counting work, of nodes of two and of eight: that takes time, so it is a kernel of its own.
#version 460
layout(local_size_x_id = 0) in;
layout(constant_id = 2) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
#define HEDGEROW_COUNTS_WORK
#include "gpu/division.glsl"
#include "trace/ray_query_names.glsl"
#include "measure/ray_query.glsl"
