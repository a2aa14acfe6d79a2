// The records of geometries whose ranges lie in device memory: each is moved by its range, and the next begins behind it.
//
// reads   ranges: VkAccelerationStructureBuildRangeInfoKHR, `stride` bytes apart; records, whose `first` is the most primitives
// writes  records[0..count], and records[count].first: where the primitives end
// needs   one workgroup; a barrier before (the records) and after
#version 460
#include "bvh/geometry.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Records { Geometry geometry[]; };

layout(push_constant, scalar) uniform RangesArguments {
    Records records;
    uvec2 ranges;
    uint stride;
    uint count;
    uint boxes;
};

// Primitives of the geometries of each invocation.
shared uint primitives_of[gl_WorkGroupSize.x];

uint primitives_in(uint i) {
    return min(Words(address_of(ranges, i, stride)).word[0], records.geometry[i].first);
}

// The record of a geometry moved by its range.
Geometry moved(Geometry g, Words range, uint first) {
    uint offset = range.word[1], first_vertex = range.word[2];
    bool has_indices = (g.formats >> 16 & 0xFFu) != 0u;
    if (boxes == 0u && has_indices) g.indices = address_of(g.indices, offset, 1u);
    else g.vertices = address_of(g.vertices, offset, 1u);
    if (boxes == 0u) g.vertices = address_of(g.vertices, first_vertex, g.vertex_stride);
    if (any(notEqual(g.transform, uvec2(0)))) g.transform = address_of(g.transform, range.word[3], 1u);
    g.vertex_count -= min(first_vertex, g.vertex_count);
    g.first = first;
    return g;
}

void main() {
    // Each invocation has a run of geometries, so that it knows where the first of them begins by one number of each before.
    uint run = (count + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
    uint begin = min(gl_LocalInvocationIndex * run, count), end = min(begin + run, count);
    uint sum = 0;
    for (uint i = begin; i < end; ++i) sum += primitives_in(i);
    primitives_of[gl_LocalInvocationIndex] = sum;
    barrier();
    uint first = 0;
    for (uint lane = 0; lane < gl_LocalInvocationIndex; ++lane) first += primitives_of[lane];
    for (uint i = begin; i < end; ++i) {
        uint primitive_count = primitives_in(i);
        records.geometry[i] = moved(records.geometry[i], Words(address_of(ranges, i, stride)), first);
        first += primitive_count;
    }
    if (end == count && (begin < count || gl_LocalInvocationIndex == 0u)) records.geometry[count].first = first;
}
