// Traces rays, each by one invocation: trace/tracer/single.glsl.
#version 460
#include "trace/tracer/single.glsl"
