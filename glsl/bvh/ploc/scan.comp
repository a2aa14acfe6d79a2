#version 460
// Where what is left of each tile goes, and how much it is; one workgroup: see bvh/ploc.glsl for the contract.
#include "bvh/ploc.glsl"

// The round's, even or odd.
layout(constant_id = 8) const uint ROUND = 0;

void main() {
    ploc_scan(ROUND);
}
