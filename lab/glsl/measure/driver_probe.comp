// What the driver's own ray queries report: the shader that asks ours, without our header.
#version 460
#include "measure/probe.glsl"
