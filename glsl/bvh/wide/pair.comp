#version 460
// Finds triangles in leaves that share an edge, and how many units the leaves of a node take: see bvh/wide/collapse.glsl for the contract,
// src/bvh/wide/pairs.rs for the rule.
#include "bvh/wide/pair.glsl"

void main() {
    find_pairs();
}
