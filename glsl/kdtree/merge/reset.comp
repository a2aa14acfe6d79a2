#version 460
// The state of a build that begins behind what there is; one workgroup. See kdtree/merge.glsl.
#include "kdtree/encode.glsl"

void main() {
    kd_reset();
    if (gl_LocalInvocationIndex != 0u) return;
    KdState state = build_state();
    KdHeader header = KdStructure(structure_address).header;
    // Triangles that are longer than those of the static tree have room of their own.
    state.reach = header.reach;
    state.first_record = header.active_count;
    state.node_count = header.node_count;
    state.leaf_count = header.reference_count;
}
