#version 460
// The records and the references of the root; workgroups share the tiles. See kdtree/builder.glsl.
#include "kdtree/encode.glsl"

void main() {
    for (uint i = group_number(); i < tile_count(); i += gl_NumWorkGroups.x) kd_records(i);
}
