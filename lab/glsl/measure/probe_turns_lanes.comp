// The same as measure/probe_turns.comp, with loads lane by lane, of structures in nodes of two: the tests.
#version 460
// gl_WorkGroupSize.x by a constant of its own.
layout(constant_id = 4) const uint LANES = 16;
#define HEDGEROW_LANES LANES
#define HEDGEROW_FORMS HEDGEROW_NODES_OF_TWO
#define WITH_HEDGEROW
#define IN_TURN
#include "measure/probe.glsl"
