// Traces rays through a tree of quantised nodes by octants: trace/wide/octant.glsl.
#version 460
#include "trace/wide/octant.glsl"
