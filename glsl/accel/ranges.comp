// The records of geometries whose ranges lie in device memory: each is moved by its range, and the next begins behind it.
//
// reads   ranges: VkAccelerationStructureBuildRangeInfoKHR, `stride` bytes apart; records, whose `first` is the most primitives
// writes  records[0..count], and records[count].first: where the primitives end
// needs   one invocation; a barrier before (the records) and after
#version 460
#include "bvh/geometry.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Records { Geometry geometry[]; };

layout(push_constant, scalar) uniform Arguments {
    Records records;
    uvec2 ranges;
    uint stride;
    uint count;
    uint boxes;
};

void main() {
    if (gl_LocalInvocationIndex != 0) return;
    uint first = 0;
    for (uint i = 0; i < count; ++i) {
        Words range = Words(address_of(ranges, i, stride));
        Geometry g = records.geometry[i];
        uint primitive_count = min(range.word[0], g.first), offset = range.word[1], first_vertex = range.word[2];
        bool has_indices = (g.formats >> 16 & 0xFFu) != 0u;
        if (boxes == 0u && has_indices) g.indices = address_of(g.indices, offset, 1u);
        else g.vertices = address_of(g.vertices, offset, 1u);
        if (boxes == 0u) g.vertices = address_of(g.vertices, first_vertex, g.vertex_stride);
        if (any(notEqual(g.transform, uvec2(0)))) g.transform = address_of(g.transform, range.word[3], 1u);
        g.vertex_count -= min(first_vertex, g.vertex_count);
        g.first = first;
        first += primitive_count;
        records.geometry[i] = g;
    }
    records.geometry[count].first = first;
}
