#version 460
// Nodes of 4 children as floats: see trace/wide/tracer.glsl for the contract.
#define WIDTH 4
#define QUANTISED 0
#define HEDGEROW_LEVELS 180
#include "trace/wide/tracer.glsl"
