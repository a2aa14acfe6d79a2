// Work of every `stride`-th ray in a tree, added up: see trace/trial.glsl for the contract. The walk is that of tracer/single.comp.
//
// needs  any subgroup size
#version 460
// Before the includes: the stack's arrays have the workgroup's size.
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
#include "trace/walk.glsl"

void main() {
    Triangles triangles = triangles_of(structure);
    Child root = structure.header.root;
    bool usable = can_be_traced(structure, KIND_TRIANGLES);
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = start + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, start + (gl_WorkGroupID.x + 1) * group_rays);

    Walk walk;
    bool going = false;
    uint low = 0, high = 0;
    while (true) {
        if (!going) {
            if (next >= end) break;
            begin(rays.ray[first + next * stride], root, usable, walk);
            next += gl_WorkGroupSize.x;
            going = true;
        }
        if (at_node(walk)) visit(structure.nodes[walk.index], walk);
        if (at_triangle(walk)) test(triangles.triangle[walk.index], ANY_HIT, walk);
        if (walk.left == NOTHING) {
            going = go_on(walk);
            if (!going) {
                uint carry;
                low = uaddCarry(low, c_t * walk.work.x + c_i * walk.work.y, carry);
                high += carry;
            }
        }
    }
    if ((low | high) == 0u) return;
    uint before = atomicAdd(sums.word[0], low);
    high += before > 0xFFFFFFFFu - low ? 1u : 0u;
    if (high != 0u) atomicAdd(sums.word[1], high);
}
