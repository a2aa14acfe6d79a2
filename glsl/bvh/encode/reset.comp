#version 460
// Sets the state up before a build: empty bounds, for a chain of dispatches; one workgroup.
//
// writes  state
// needs   one barrier after
#include "bvh/encode.glsl"

void main() {
    reset_build(0);
}
