// The same as measure/query_turns.comp, with loads lane by lane (trace/lanes.glsl).
#version 460
layout(local_size_x_id = 0) in;
layout(constant_id = 2) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
// Lanes of the workgroup: gl_WorkGroupSize.x by a constant of its own.
layout(constant_id = 4) const uint LANES = 16;
#define HEDGEROW_LANES LANES
layout(constant_id = 5) const bool ONE_LEVEL = false;
#define HEDGEROW_ONE_LEVEL ONE_LEVEL
layout(constant_id = 6) const uint FORMS = 3;
#define HEDGEROW_FORMS FORMS
#define HEDGEROW_ALL_BUILT true
#define IN_TURN
#include "gpu/division.glsl"
#include "trace/ray_query_names.glsl"
#include "measure/ray_query.glsl"
