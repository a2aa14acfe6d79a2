#version 460
// Nodes of 4 children as floats: see trace/tracer_wide.glsl for the contract.
#define WIDTH 4
#define QUANTISED 0
#define HEDGEROW_LEVELS 180
#include "trace/tracer_wide.glsl"
