#version 460
// An empty grid over the root's box: see trace/flux.glsl for the contract.
#include "trace/flux.glsl"

float places(float edge) {
    return edge < FLUX_SHORTEST ? 0.0 : flux_quotient(FLUX_PLACES, edge);
}

void main() {
    uint at = invocation_number();
    if (at < FLUX_POINTS * FLUX_POINTS * FLUX_POINTS) grid.point[at] = uvec4(0);
    if (at != 0u) return;
    Header header = structure.header;
    bool has_box = header.magic == MAGIC && header.active_count != 0u;
    vec3 lo = has_box ? header.root.lo : vec3(0.0), hi = has_box ? header.root.hi : vec3(0.0);
    float scale = has_box ? header.area_scale : 1.0;
    precise vec3 low = lo * scale;
    precise vec3 edges = hi * scale - low;
    grid.lo = low;
    grid.scale = scale;
    grid.factor = vec3(places(edges.x), places(edges.y), places(edges.z));
    grid.reserved = 0u;
}
