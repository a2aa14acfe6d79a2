#version 460
// Where subtrees go, and the header of the merged tree; one workgroup. See kdtree/merge.glsl.
#include "kdtree/merge_build.glsl"

void main() {
    kd_order_merged();
}
