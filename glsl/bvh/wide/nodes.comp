#version 460
// Every wide node to its index, and the header: see bvh/wide/collapse.glsl for the contract.
#include "bvh/wide/nodes.glsl"

void main() {
    write_nodes();
}
