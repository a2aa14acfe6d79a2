// Traces rays, each by one invocation: the twin of src/trace/host.rs, visit for visit.
//
// The nearer child first; a child that waits is left out if it is farther than the best hit by then. One loop for everything
// that a ray may do next: two nodes, a triangle, take what waits, take the next ray; each lane does what it has to do. On a
// CPU that keeps the lanes busy (Aila and Laine 2009 call it if-if; with while-while 1.1 to 1.7 times the time), and an
// invocation that goes on to its next ray alone does not wait for the longest ray of its subgroup (1.1 to 1.6 times). Trees
// have five nodes on a ray's way for a triangle: two a round are faster than one by 5 to 10%, three are not. On a GPU an
// invocation takes one ray (`rays_each`).
//
// reads   structure, rays[first..count]
// writes  hits[first..count]; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; any subgroup size
#version 460
// Before the includes: the stack's arrays have the workgroup's size.
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS

#include "trace/buffers.glsl"
#include "trace/slab.glsl"
#include "trace/stack.glsl"
#include "trace/triangle.glsl"

// In place of a leaf's count: nothing at hand, take what waits.
const uint NOTHING = 0xffffffffu;

// Two of the three things that a round does: the children of the node at hand …
void visit_node(HedgerowPreparedRay ray, float best, inout uint index, inout uint left, inout uint level) {
    Child a = structure.nodes[index].left;
    Child b = structure.nodes[index].right;
    bool enters_a, enters_b;
    float enter_a = hedgerow_enter(ray, a.lo, a.hi, best, enters_a);
    float enter_b = hedgerow_enter(ray, b.lo, b.hi, best, enters_b);
    bool b_first = enters_b && (!enters_a || enter_b < enter_a);
    if (enters_a && enters_b) {
        hedgerow_put(level, b_first ? HedgerowWaiting(a.index, a.count, enter_a) : HedgerowWaiting(b.index, b.count, enter_b));
        level++;
    }
    index = b_first ? b.index : a.index;
    left = enters_a || enters_b ? b_first ? b.count : a.count : NOTHING;
}

// … and what waits. Equally far is not too far: an equally near hit with a lower index may be there.
void take_waiting(float best, inout uint index, inout uint left, inout uint level) {
    level--;
    HedgerowWaiting waiting = hedgerow_taken(level);
    index = waiting.index;
    left = waiting.enter <= best ? waiting.count : NOTHING;
}

void main() {
    Triangles triangles = triangles_of(structure);
    Child root = structure.header.root;
    const uint UNUSABLE = STATUS_TOO_DEEP | STATUS_SPIN_RAN_OUT;
    bool usable = structure.header.active_count != 0u && (structure.header.status & UNUSABLE) == 0u;
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1) * group_rays);

    HedgerowPreparedRay ray;
    bool going = false;
    uint i;
    float best;
    uvec2 work;
    // The node at hand, or the triangles left of the leaf at hand; what waits.
    uint index, left, level;
    while (true) {
        if (!going) {
            if (next >= end) break;
            i = next;
            next += gl_WorkGroupSize.x;
            going = hedgerow_prepare(rays.ray[i], root.lo, root.hi, ray) && usable;
            hits.hit[i] = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
            best = ray.t_max;
            work = uvec2(0);
            index = root.index;
            left = going ? root.count : NOTHING;
            level = 0;
        }
        if (left == 0u) {
            work.x++;
            visit_node(ray, best, index, left, level);
        }
        if (left == 0u) {
            work.x++;
            visit_node(ray, best, index, left, level);
        }
        if (left != 0u && left != NOTHING) {
            work.y++;
            Triangle triangle = triangles.triangle[index];
            index++;
            left = left == 1u ? NOTHING : left - 1u;
            vec3 met;
            if (hedgerow_meet(ray, triangle.v0, triangle.v1, triangle.v2, met)) {
                if (ray.t_min < met.x && met.x < ray.t_max &&
                    (met.x < best || met.x == best && triangle.primitive < hits.hit[i].primitive)) {
                    best = met.x;
                    hits.hit[i] = HedgerowHit(ANY_HIT ? 0.0 : met.x, triangle.primitive, met.y, met.z);
                    if (ANY_HIT) {
                        left = NOTHING;
                        level = 0;
                    }
                }
            }
        }
        if (left == NOTHING) {
            going = level > 0u;
            if (going) take_waiting(best, index, left, level);
            else if (COUNT_WORK) works.work[i] = work;
        }
    }
}
