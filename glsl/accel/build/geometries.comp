// Writes the records of a build's geometries from the push constants to where the build reads them (bvh/geometry.glsl).
//
// reads   nothing
// writes  records[at..at + count]
// needs   one workgroup; a barrier (shader write -> shader read) after
#version 460
#include "bvh/geometry.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) writeonly buffer Records { Geometry geometry[]; };

layout(push_constant, scalar) uniform GeometriesArguments {
    Records records;
    uint at;
    uint count;
    Geometry given[2];
};

void main() {
    for (uint i = gl_LocalInvocationIndex; i < count; i += gl_WorkGroupSize.x) records.geometry[at + i] = given[i];
}
