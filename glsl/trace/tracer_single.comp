// Traces rays, one an invocation: the twin of src/trace/host.rs, visit for visit.
//
// While-while (Aila and Laine 2009), the nearer child first; a child that waits is left out if it is farther than the best
// hit by then. Of loops, branches and what is carried through them there is as little as can be: on a CPU each costs moves
// of whole vectors, on a GPU registers. So a hit is written when it is found, and a leaf's triangles are taken one a round.
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

void main() {
    uint i = first + gl_GlobalInvocationID.x;
    if (i >= count) return;
    Triangles triangles = triangles_of(structure);
    HedgerowPreparedRay ray;
    bool going = hedgerow_prepare(rays.ray[i], structure.header.root.lo, structure.header.root.hi, ray) &&
                 structure.header.active_count != 0u && (structure.header.status & (STATUS_TOO_DEEP | STATUS_SPIN_RAN_OUT)) == 0u;
    hits.hit[i] = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
    float best = ray.t_max;
    uvec2 work = uvec2(0);

    // The node at hand, or the triangles left of the leaf at hand.
    uint index = structure.header.root.index;
    uint left = structure.header.root.count;
    uint level = 0;
    while (going) {
        while (left == 0u) {
            work.x++;
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
            left = b_first ? b.count : a.count;
            if (!(enters_a || enters_b)) {
                left = NOTHING;
                if (level > 0u) {
                    level--;
                    HedgerowWaiting waiting = hedgerow_taken(level);
                    index = waiting.index;
                    // Equally far is not too far: an equally near hit with a lower index may be there.
                    left = waiting.enter <= best ? waiting.count : NOTHING;
                }
            }
        }
        if (left != NOTHING) {
            work.y++;
            Triangle triangle = triangles.triangle[index];
            index++;
            left--;
            vec3 met;
            if (hedgerow_meet(ray, triangle.v0, triangle.v1, triangle.v2, met)) {
                if (ray.t_min < met.x && met.x < ray.t_max &&
                    (met.x < best || met.x == best && triangle.primitive < hits.hit[i].primitive)) {
                    best = met.x;
                    hits.hit[i] = HedgerowHit(ANY_HIT ? 0.0 : met.x, triangle.primitive, met.y, met.z);
                    if (ANY_HIT) {
                        left = 0;
                        level = 0;
                    }
                }
            }
        }
        if (left == 0u || left == NOTHING) {
            left = NOTHING;
            going = level > 0u;
            if (going) {
                level--;
                HedgerowWaiting waiting = hedgerow_taken(level);
                index = waiting.index;
                left = waiting.enter <= best ? waiting.count : NOTHING;
            }
        }
    }
    if (COUNT_WORK) works.work[i] = work;
}
