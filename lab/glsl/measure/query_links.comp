// The same as measure/query.comp, counting what rays do below each node (HEDGEROW_LINK_COUNTS in trace/query_walk.glsl).
//
// writes  works: a LinkCount for each link of the one bottom-level structure; zero before
#version 460
#extension GL_EXT_buffer_reference_uvec2 : require
layout(local_size_x_id = 0) in;
#include "measure/rays.glsl"

uvec2 counts_of(uvec2 bottom_level) {
    return uvec2(works);
}

#define HEDGEROW_LINK_COUNTS counts_of
#define HEDGEROW_FORMS HEDGEROW_NODES_OF_TWO
#include "gpu/division.glsl"
#include "trace/ray_query_names.glsl"
#include "measure/ray_query.glsl"
