#version 460
// Sets the state up before a build; one workgroup. See kdtree/builder.glsl.
#include "kdtree/encode.glsl"

void main() {
    kd_reset();
}
