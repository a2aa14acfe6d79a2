#version 460
// The sides of the references of a level, and where each chunk puts what it has; workgroups share the chunks. See kdtree/builder.glsl.
#include "kdtree/classify.glsl"
#include "kdtree/scan.glsl"

void main() {
    uint chunks = build_state().chunk_count[level];
    for (uint i = group_number(); i < chunks; i += gl_NumWorkGroups.x) {
        kd_classify_chunk(i, level);
        kd_sum_chunk(i, level);
    }
}
