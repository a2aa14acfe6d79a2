#version 460
// All phases for few primitives, by one workgroup: see bvh/encode.glsl for the contract.
//
// A chain of dispatches costs a small tree more than its work.
#define HEDGEROW_ONE_WORKGROUP
#include "bvh/encode/alone.glsl"

void main() {
    encode_alone();
}
