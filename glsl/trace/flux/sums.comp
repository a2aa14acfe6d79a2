#version 460
// Sums along one axis, each line of points by an invocation: see trace/flux.glsl for the contract.
#include "trace/flux.glsl"

void main() {
    uint line = invocation_number();
    if (line >= FLUX_POINTS * FLUX_POINTS) return;
    uvec2 across = uvec2(line / FLUX_POINTS, line % FLUX_POINTS);
    // What crosses planes along the axis is not summed along it.
    uvec4 taken = uvec4(axis != 0u, axis != 1u, axis != 2u, 1u);
    uvec4 sum = uvec4(0);
    for (uint i = 0; i < FLUX_POINTS; ++i) {
        uvec3 at = axis == 0u ? uvec3(i, across) : axis == 1u ? uvec3(across.x, i, across.y) : uvec3(across, i);
        uvec4 here = grid.point[flux_point(at)];
        sum += here * taken;
        grid.point[flux_point(at)] = mix(here, sum, notEqual(taken, uvec4(0)));
    }
}
