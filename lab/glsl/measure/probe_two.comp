// The same as measure/probe.comp, while another query of the same ray, into `told`, is on its way: the tests.
#version 460
#define WITH_HEDGEROW
#define HEDGEROW_QUERIES 2
#define WITH_ANOTHER
#include "gpu/division.glsl"
#include "measure/probe.glsl"
