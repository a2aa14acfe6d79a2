// The same as measure/probe.comp, with five rays for each invocation, in turn (trace/query_turns.glsl): the tests.
#version 460
#define WITH_HEDGEROW
#define IN_TURN
#include "gpu/division.glsl"
#include "measure/probe.glsl"
