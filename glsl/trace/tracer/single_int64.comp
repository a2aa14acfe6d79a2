// The same as trace/tracer/single.comp, with loads of 64 bits: a module of its own, for it needs `shaderInt64` (trace/long_loads.glsl).
#version 460
#define HEDGEROW_INT64
#include "trace/tracer/single.glsl"
