#version 460
// Which primitives there are, and how long their sides are; a workgroup a tile. See kdtree/builder.glsl.
#include "kdtree/encode.glsl"

void main() {
    for (uint i = group_number(); i < tile_count(); i += gl_NumWorkGroups.x) kd_count(i);
}
