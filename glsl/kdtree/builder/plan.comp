#version 460
// Where the records of each tile begin; one workgroup. See kdtree/builder.glsl.
#include "kdtree/encode.glsl"

void main() {
    kd_plan();
}
