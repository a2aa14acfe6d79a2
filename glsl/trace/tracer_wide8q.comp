#version 460
// Nodes of 8 children as bytes: see trace/tracer_wide.glsl for the contract.
#define WIDTH 8
#define QUANTISED 1
#define HEDGEROW_LEVELS 343
#include "trace/tracer_wide.glsl"
