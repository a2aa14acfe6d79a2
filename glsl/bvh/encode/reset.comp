#version 460
// Sets the state up before a build: empty bounds, for a chain of dispatches; and the fences, of codes that have sections; one workgroup.
//
// reads   the primitives, in codes that have sections
// writes  state
// needs   one barrier after
#include "bvh/encode.glsl"

void main() {
    reset_build(0);
    if (HAS_SECTIONS) find_fences();
}
