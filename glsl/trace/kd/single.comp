// Traces rays through a kd-tree, each by one invocation, which loads what its ray needs by itself: the loop of
// trace/tracer/single.comp.
//
// reads   structure, a KdTree; rays[first..count]
// writes  hits[first..count]; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; any subgroup size
#version 460
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint CAPACITY = 0;
layout(constant_id = 4) const bool PUSH_DOWN = false;
#define HEDGEROW_KD_CAPACITY CAPACITY
#define HEDGEROW_KD_PUSH_DOWN PUSH_DOWN

#include "trace/buffers.glsl"
#include "trace/walk_kd.glsl"

void main() {
    HedgerowKdTree tree = hedgerow_kd_tree(uvec2(structure));
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1) * group_rays);

    HedgerowKdWalk walk;
    bool going = false;
    uint i;
    while (true) {
        if (!going) {
            if (next >= end) break;
            i = next;
            next += gl_WorkGroupSize.x;
            hedgerow_kd_begin(rays.ray[i], tree, walk);
        }
        going = hedgerow_kd_proceed(tree, ANY_HIT, walk);
        if (!going) {
            hits.hit[i] = walk.hit;
            if (COUNT_WORK) works.work[i] = walk.work;
        }
    }
}
