// Rays that were traced fill the grid of bvh/flux.glsl: src/trace/flux.rs records the steps, src/trace/twin/flux.rs is the twin: the same
// numbers.
//
//   begin  reads the structure's header               writes the grid's head; zeroes its points
//   rays   reads every `stride`-th of rays and hits   adds to points: each segment where it crosses and ends
//   sums   reads and writes points, along one axis    three times: sums from the corner
//
// needs  one barrier before, between each two, and after; any subgroup size
#ifndef HEDGEROW_TRACE_FLUX
#define HEDGEROW_TRACE_FLUX
#include "gpu/pass.glsl"
#include "bvh/flux.glsl"
#include "trace/ray.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Rays { HedgerowRay ray[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Hits { HedgerowHit hit[]; };

layout(push_constant, scalar) uniform FluxArguments {
    Structure structure;
    FluxGrid grid;
    Words counts;     // the grid's points, word by word
    Rays rays;
    Hits hits;
    uint first;       // ray
    uint stride;      // to the next one that is taken
    uint begin;       // of those that are taken, the first of this dispatch
    uint count;       // how many are taken
    uint axis;        // of sums
};
#endif
