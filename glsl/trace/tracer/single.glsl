// Traces rays, each by one invocation, which loads what its ray needs by itself.
//
// One loop for everything that a ray may do next: two nodes, a triangle, take what waits, take the next ray; each lane does
// what it has to do. On a CPU that keeps the lanes busy (Aila and Laine 2009 call it if-if; with while-while 1.1 to 1.7 times
// the time), and an invocation that goes on to its next ray alone does not wait for the longest ray of its subgroup (1.1 to
// 1.6 times). Trees have five nodes on a ray's way for a triangle: two a round are faster than one by 5 to 10%, three are
// not. On a GPU an invocation takes one ray (`rays_each`).
//
// reads   structure, rays[first..count]
// writes  hits[first..count]; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; any subgroup size
// Before the includes: the stack's arrays have the workgroup's size.
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
// Of rays that end at any hit.
layout(constant_id = 6) const bool LEFT_FIRST = false;

#include "trace/vector_loads.glsl"
#include "trace/walk.glsl"

void step_to(Node node, inout Walk walk) {
    if (LEFT_FIRST) visit_left_first(node, walk);
    else visit(node, walk);
}

void main() {
    Triangles triangles = triangles_of(structure);
    Child root = structure.header.root;
    bool usable = can_be_traced(structure, KIND_TRIANGLES);
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1) * group_rays);

    Walk walk;
    bool going = false;
    uint i;
    while (true) {
        if (!going) {
            if (next >= end) break;
            i = next;
            next += gl_WorkGroupSize.x;
            begin(rays.ray[i], root, usable, walk);
            going = true;
        }
        if (at_node(walk)) step_to(node_at(structure, walk.index), walk);
        if (at_node(walk)) step_to(node_at(structure, walk.index), walk);
        if (at_triangle(walk)) test(triangle_at(triangles, walk.index), ANY_HIT, walk);
        if (walk.left == NOTHING) {
            going = LEFT_FIRST ? go_on_left_first(walk) : go_on(walk);
            if (!going) {
                hits.hit[i] = walk.hit;
                if (COUNT_WORK) works.work[i] = walk.work;
            }
        }
    }
}
