#version 460
// The records in leaves, and the table of geometries: see bvh/wide/collapse.glsl for the contract.
#include "bvh/wide/records.glsl"

void main() {
    write_records();
}
