#version 460
// The parts of all triangles: see bvh/split.glsl for the contract.
#include "bvh/split.glsl"

void main() {
    write_references(group_number());
}
