// The same as measure/probe_turns.comp, with loads lane by lane: the tests.
#version 460
// gl_WorkGroupSize.x by a constant of its own.
layout(constant_id = 4) const uint LANES = 16;
#define HEDGEROW_LANES LANES
layout(constant_id = 5) const bool ONE_LEVEL = false;
#define HEDGEROW_ONE_LEVEL ONE_LEVEL
layout(constant_id = 6) const bool ALL_BUILT = false;
#define HEDGEROW_ALL_BUILT ALL_BUILT
#define WITH_HEDGEROW
#define IN_TURN
#include "gpu/division.glsl"
#include "measure/probe.glsl"
