// Where a ray enters the boxes of a quantised node: the twin of src/trace/twin/wide.rs, bit for bit. The proof of src/trace/slab.rs
// is for any box around the triangle, and those that come out of the bytes are (src/bvh/wide/quantised.rs); they are widened by
// what the node's whole grid needs, once for all eight.
#ifndef HEDGEROW_TRACE_QUANTISED_BOXES
#define HEDGEROW_TRACE_QUANTISED_BOXES
#extension GL_EXT_control_flow_attributes : require
#include "bvh/wide.glsl"
#include "trace/quantised_slots.glsl"
#include "trace/slab.glsl"

// Distances to the planes through a corner of the slot's box, `base` being what byte 0 stands for.
vec3 distances_to(vec3 base, vec3 cell, vec3 inverse, uvec2 x, uvec2 y, uvec2 z, uint slot) {
    uint shift = (slot & 3u) * 8;
    uvec3 word = slot < 4 ? uvec3(x.x, y.x, z.x) : uvec3(x.y, y.y, z.y);
    // As signed numbers: CPUs turn those into floats by one instruction.
    precise vec3 distances = (base + vec3(ivec3(word >> shift & 0xFFu)) * cell) * inverse;
    return distances;
}

// Where a ray enters a box whose planes it meets at these distances, those that it meets first being `near`.
float enter_box(vec3 near, vec3 far, float t_min, float t_best) {
    float enter = max(max(near.x, near.y), max(near.z, t_min));
    float leave = min(min(far.x, far.y), min(far.z, t_best));
    return enter <= leave ? enter : HEDGEROW_INFINITY;
}

// For each slot where the ray enters its box, infinity if it does not between t_min and t_best. A slot without a child has a box
// inside out, which is not entered but where it is flat.
void enter_quantised(HedgerowPreparedRay ray, QuantisedNode node, float t_best, out float enters[8]) {
    uint e = node.exponents_and_nodes;
    vec3 cell = uintBitsToFloat((uvec3(e, e >> 8, e >> 16) & 0xFFu) << 23);
    precise vec3 least = uintBitsToFloat(node.origin) - ray.origin;
    precise vec3 greatest = least + 255.0 * cell;
    float slack = hedgerow_slack_of(ray, max(greatest, -least));
    precise vec3 before = least - slack;
    precise vec3 behind = least + slack;
    // Which corners are met first is the same for all children: hedgerow_enter sorts each pair of distances.
    bvec3 down = lessThan(ray.inverse, vec3(0.0));
    uvec2 near_x = down.x ? node.hi[0] : node.lo[0], far_x = down.x ? node.lo[0] : node.hi[0];
    uvec2 near_y = down.y ? node.hi[1] : node.lo[1], far_y = down.y ? node.lo[1] : node.hi[1];
    uvec2 near_z = down.z ? node.hi[2] : node.lo[2], far_z = down.z ? node.lo[2] : node.hi[2];
    vec3 base_near = mix(before, behind, down);
    vec3 base_far = mix(behind, before, down);
    // No loop: where shaderc unrolls one, the copies of what is `precise` are not.
#define ENTER_SLOT(slot)                                                                                              \
    enters[slot] = enter_box(distances_to(base_near, cell, ray.inverse, near_x, near_y, near_z, slot),                \
                             distances_to(base_far, cell, ray.inverse, far_x, far_y, far_z, slot), ray.t_min, t_best)
    ENTER_SLOT(0); ENTER_SLOT(1); ENTER_SLOT(2); ENTER_SLOT(3);
    ENTER_SLOT(4); ENTER_SLOT(5); ENTER_SLOT(6); ENTER_SLOT(7);
#undef ENTER_SLOT
}

// The place of the slot that is entered first, and the leading half of where the nearest of the others is. Of those that are entered within
// eight floats of each other the one that comes first in the octant, for its place is in the last bits of what is compared. Of a ray that
// ends at any hit the place that comes first in the octant, and no distance: no hit brings the end of the ray nearer, so no group is too far.
uvec2 next_of_group(uint slots, uint octant, float enters[8], bool any_hit) {
    const int NONE = 0x7FFFFFFF;
    int first = NONE, second = NONE;
    [[unroll]] for (uint slot = 0; slot < 8; ++slot) {
        int key = floatBitsToInt(enters[slot]) & ~7 | int(slot ^ octant);
        key = (slots >> slot & 1u) != 0u ? key : NONE;
        second = min(second, max(first, key));
        first = min(first, key);
    }
    uvec2 next = uvec2(uint(first) & 7u, leading_half(intBitsToFloat(second)));
    if (any_hit) next = uvec2(uint(findLSB(in_octant(slots, octant))), leading_half(-HEDGEROW_INFINITY));
    return next;
}
#endif
