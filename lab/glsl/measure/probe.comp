// Everything that a query of ours reports, for each ray, in a shader as an engine has it: `hedgerow check`, and the tests.
//
// reads   rays[count], a structure of either level
// writes  reports[count]
// needs   one barrier before and after; a fixed workgroup of 64; any subgroup size
#version 460
#define WITH_HEDGEROW
layout(constant_id = 5) const bool ONE_LEVEL = false;
#define HEDGEROW_ONE_LEVEL ONE_LEVEL
#include "gpu/division.glsl"
#include "measure/probe.glsl"
