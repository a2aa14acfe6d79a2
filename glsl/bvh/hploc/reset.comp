#version 460
// Sets the state up before a build: empty bounds, and the pool with the tasks of each phase; one workgroup.
//
// writes  state
// needs   one barrier after
#include "bvh/encode.glsl"

void main() {
    // Two of the hierarchy, and three of the collapse.
    reset_build(5);
}
