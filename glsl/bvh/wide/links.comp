#version 460
// What names each node, and where climbs begin: see bvh/wide/costs.glsl for the contract.
#include "bvh/wide/costs.glsl"

void main() {
    find_links(slots_in_use());
}
