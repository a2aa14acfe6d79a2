#version 460
// The same as trace/wide/eight.comp, with loads of 64 bits: a module of its own, for it needs `shaderInt64` (trace/long_loads.glsl).
#define HEDGEROW_INT64
#define WIDTH 8
#define QUANTISED 0
#define HEDGEROW_LEVELS (LEFT_FIRST ? 48u : 336u)
#include "trace/wide/tracer.glsl"
