#version 460
// Nodes of 4 children as floats: see trace/wide/tracer.glsl for the contract.
#define WIDTH 4
#define QUANTISED 0
#define HEDGEROW_LEVELS (LEFT_FIRST ? 60u : 180u)
#include "trace/wide/tracer.glsl"
