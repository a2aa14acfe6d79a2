#version 460
// The references of the marked leaves; a workgroup a leaf. See kdtree/merge.glsl.
#include "kdtree/merge/build.glsl"

void main() {
    uint marked = merge_state().marked_count;
    for (uint m = group_number(); m < marked; m += gl_NumWorkGroups.x) kd_gather(m);
}
