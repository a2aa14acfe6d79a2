// Traces rays through a wide tree by distance or left first, each by one invocation, which loads what its ray needs by itself: the loop of
// trace/tracer/single.comp, one node a round, for a wide tree has as many triangles on a ray's way.
//
// reads   structure, rays[first..count]
// writes  hits[first..count]; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; any subgroup size; WIDTH, QUANTISED and
//         HEDGEROW_LEVELS (src/trace/wide.rs, `Order::stack_levels`)
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
// Of rays that end at any hit.
layout(constant_id = 6) const bool LEFT_FIRST = false;
#include "gpu/division.glsl"

#if QUANTISED
#include "trace/walk_wide_quantised.glsl"
#define NODES QuantisedNodes
#define NODE_AT quantised_node_at
#define CHILD_IN_SLOT quantised_child_in_slot

void test_next(uvec2 records, inout Walk walk) {
    Triangle triangle = triangle_at_unit(records, walk.index);
    SecondOfPair second;
    if (has_second(triangle)) second = second_of_pair_at(records, walk.index);
    test_record(triangle, second, ANY_HIT, walk);
}
#else
#include "trace/walk_wide.glsl"
#define NODES WideNodes
#define NODE_AT wide_node_at
#define CHILD_IN_SLOT wide_child_in_slot

void test_next(uvec2 records, inout Walk walk) {
    test(triangle_at(Triangles(records), walk.index), ANY_HIT, walk);
}
#endif

// LEFT_FIRST: takes the next child of the node at hand, or of one that waits; whether there was any.
bool go_on_left_first(NODES nodes, inout Walk walk) {
    if (walk.hit.primitive != HEDGEROW_NONE) return false;
    if (wide_rest == 0u) {
        if (walk.level == 0u) return false;
        walk.level--;
        uvec2 waiting = hedgerow_entry(walk.level);
        wide_node = waiting.x;
        wide_rest = waiting.y;
    }
    uvec2 child = CHILD_IN_SLOT(nodes, wide_node, uint(findLSB(wide_rest)));
    wide_rest &= wide_rest - 1u;
    walk.index = child.x;
    walk.left = child.y;
    count_leaf(walk);
    return true;
}

void main() {
    uvec2 records = wide_records_at(uvec2(structure), structure.header.node_slots, wide_node_bytes(WIDTH, QUANTISED != 0));
    NODES nodes = NODES(wide_nodes_at(uvec2(structure)));
    Child root = structure.header.root;
    bool usable = can_be_traced(structure, wide_kind(KIND_TRIANGLES, WIDTH, QUANTISED != 0));
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
            wide_rest = 0u;
            going = true;
        }
        if (at_node(walk)) visit_wide(NODE_AT(nodes, walk.index), walk);
        if (at_triangle(walk)) test_next(records, walk);
        if (walk.left == NOTHING) {
            going = LEFT_FIRST ? go_on_left_first(nodes, walk) : go_on(walk);
            if (!going) {
                hits.hit[i] = walk.hit;
                if (COUNT_WORK) works.work[i] = walk.work;
            }
        }
    }
}
