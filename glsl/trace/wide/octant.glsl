// Traces rays through a tree of quantised nodes, each by one invocation, which loads what its ray needs by itself: the loop of
// trace/tracer/single.comp.
//
// reads   structure, rays[first..count]
// writes  hits[first..count]; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; any subgroup size
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
// Where the structure is of another kind, hits stay what they are.
layout(constant_id = 7) const bool LEAVES_OTHERS = false;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
#define HEDGEROW_LEVELS 49

#include "trace/quantised_loads.glsl"
#include "trace/walk_quantised.glsl"

void main() {
    if (LEAVES_OTHERS && structure.header.kind != KIND_TRIANGLES_8Q) return;
    uvec2 records = wide_records_at(uvec2(structure), structure.header.node_slots, QUANTISED_NODE_BYTES);
    QuantisedNodes nodes = QuantisedNodes(wide_nodes_at(uvec2(structure)));
    Child root = structure.header.root;
    bool usable = can_be_traced(structure, KIND_TRIANGLES_8Q);
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1) * group_rays);

    QuantisedWalk walk;
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
        if (at_node(walk)) visit(quantised_node_at(nodes, next_node(walk)), ANY_HIT, walk);
        next_leaf(walk);
        if (at_triangle(walk)) {
            Triangle triangle = triangle_at_unit(records, walk.record);
            SecondOfPair second;
            if (has_second(triangle)) second = second_of_pair_at(records, walk.record);
            test_record(triangle, second, ANY_HIT, walk);
        }
        going = go_on(walk);
        if (!going) {
            hits.hit[i] = walk.hit;
            if (COUNT_WORK) works.work[i] = walk.work;
        }
    }
}
