#version 460
// Bins of the large tasks of a level; workgroups share their chunks. See kdtree/builder.glsl.
#include "kdtree/bin.glsl"

void main() {
    uint chunks = build_state().binned_chunks[level];
    for (uint i = group_number(); i < chunks; i += gl_NumWorkGroups.x) kd_bin_chunk(i, level);
}
