#version 460
// The root's task; one workgroup. See kdtree/builder.glsl.
#include "kdtree/encode.glsl"

void main() {
    kd_root();
}
