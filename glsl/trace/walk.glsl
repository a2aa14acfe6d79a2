// One ray on its way through a tree, step by step: the twin of src/trace/host.rs, visit for visit.
//
// The nearer child first; a child that waits is left out if it is farther than the best hit by then. A ray that ends at any hit may
// instead take the left child first, wherever it is, of a tree whose children are in order (bvh/child_order.glsl). The kernels decide
// in which order lanes take their steps; each step is the same for all of them.
#ifndef HEDGEROW_TRACE_WALK
#define HEDGEROW_TRACE_WALK
#include "trace/buffers.glsl"
#include "trace/nearest.glsl"
#include "trace/slab.glsl"
#include "trace/stack.glsl"

// In place of a leaf's count: nothing at hand, take what waits.
const uint NOTHING = 0xffffffffu;

struct Walk {
    HedgerowPreparedRay ray;
    // The node at hand (`left` is 0), or the next triangle and how many are left of its leaf, or NOTHING.
    uint index;
    uint left;
    // How many children wait.
    uint level;
    float best;
    HedgerowHit hit;
    // Nodes visited, triangles tested, leaves visited.
    uvec3 work;
};

bool at_node(Walk walk) {
    return walk.left == 0u;
}

bool at_triangle(Walk walk) {
    return walk.left != 0u && walk.left != NOTHING;
}

// What is at hand has just been taken: a leaf counts.
void count_leaf(inout Walk walk) {
    if (at_triangle(walk)) walk.work.z++;
}

// At the root; a ray that cannot hit anything has nothing at hand and nothing that waits.
void begin(HedgerowRay ray, Child root, bool usable, out Walk walk) {
    bool goes = hedgerow_prepare(ray, walk.ray) && usable;
    walk.index = root.index;
    walk.left = goes ? root.count : NOTHING;
    walk.level = 0;
    walk.best = walk.ray.t_max;
    walk.hit = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
    walk.work = uvec3(0);
    count_leaf(walk);
}

void visit(Node node, inout Walk walk) {
    walk.work.x++;
    Child a = node.left;
    Child b = node.right;
    bool enters_a, enters_b;
    float enter_a = hedgerow_enter(walk.ray, a.lo, a.hi, walk.best, enters_a);
    float enter_b = hedgerow_enter(walk.ray, b.lo, b.hi, walk.best, enters_b);
    bool b_first = enters_b && (!enters_a || enter_b < enter_a);
    if (enters_a && enters_b) {
        hedgerow_put(walk.level, b_first ? HedgerowWaiting(a.index, a.count, enter_a) : HedgerowWaiting(b.index, b.count, enter_b));
        walk.level++;
    }
    walk.index = b_first ? b.index : a.index;
    walk.left = enters_a || enters_b ? b_first ? b.count : a.count : NOTHING;
    count_leaf(walk);
}

// The same where the left child comes first, wherever it is.
void visit_left_first(Node node, inout Walk walk) {
    walk.work.x++;
    bool enters_left, enters_right;
    hedgerow_enter(walk.ray, node.left.lo, node.left.hi, walk.best, enters_left);
    hedgerow_enter(walk.ray, node.right.lo, node.right.hi, walk.best, enters_right);
    if (enters_left && enters_right) {
        hedgerow_put_anyway(walk.level, node.right.index, node.right.count);
        walk.level++;
    }
    walk.index = enters_left ? node.left.index : node.right.index;
    walk.left = enters_left ? node.left.count : enters_right ? node.right.count : NOTHING;
    count_leaf(walk);
}

// Tests a triangle; a ray that has ended has nothing at hand.
void meet(Triangle triangle, bool any_hit, inout Walk walk) {
    walk.work.y++;
    if (hit_nearer(walk.ray, triangle, any_hit, walk.best, walk.hit) && any_hit) {
        walk.left = NOTHING;
        walk.level = 0;
    }
}

// The next triangle of the leaf.
void test(Triangle triangle, bool any_hit, inout Walk walk) {
    walk.index++;
    walk.left = walk.left == 1u ? NOTHING : walk.left - 1u;
    meet(triangle, any_hit, walk);
}

// Takes what waits; whether there was any. Equally far is not too far: an equally near hit with a lower index may be there.
bool go_on(inout Walk walk) {
    bool waits = walk.level != 0u;
    if (waits) {
        walk.level--;
        HedgerowWaiting waiting = hedgerow_taken(walk.level);
        walk.index = waiting.index;
        walk.left = waiting.enter <= walk.best ? waiting.count : NOTHING;
        count_leaf(walk);
    }
    return waits;
}

// The same where it was put there by `visit_left_first`.
bool go_on_left_first(inout Walk walk) {
    bool waits = walk.level != 0u;
    if (waits) {
        walk.level--;
        uvec2 waiting = hedgerow_taken_anyway(walk.level);
        walk.index = waiting.x;
        walk.left = waiting.y;
        count_leaf(walk);
    }
    return waits;
}
#endif
