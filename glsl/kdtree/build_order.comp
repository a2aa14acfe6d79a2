#version 460
// Where subtrees go, and the header; one workgroup. See kdtree/build.glsl.
#include "kdtree/place.glsl"

void main() {
    kd_order_subtrees();
}
