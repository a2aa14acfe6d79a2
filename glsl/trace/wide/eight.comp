#version 460
// Nodes of 8 children as floats: see trace/wide/tracer.glsl for the contract.
#define WIDTH 8
#define QUANTISED 0
#define HEDGEROW_LEVELS (LEFT_FIRST ? 48u : 336u)
#include "trace/wide/tracer.glsl"
