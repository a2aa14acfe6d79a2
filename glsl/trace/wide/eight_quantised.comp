#version 460
// Nodes of 8 children as bytes: see trace/wide/tracer.glsl for the contract.
#define WIDTH 8
#define QUANTISED 1
#define HEDGEROW_LEVELS (LEFT_FIRST ? 49u : 343u)
#include "trace/wide/tracer.glsl"
