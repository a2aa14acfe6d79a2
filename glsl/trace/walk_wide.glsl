// A step of trace/walk.glsl at a node of WIDTH children as floats: the twin of src/trace/wide_host.rs, visit for visit.
//
// The children that the ray enters are sorted by where it does; the nearest is at hand then, the others wait, the farthest
// below. So many may wait at once that a shader defines HEDGEROW_LEVELS (src/trace/wide.rs, `Order::stack_levels`).
#ifndef HEDGEROW_TRACE_WALK_WIDE
#define HEDGEROW_TRACE_WALK_WIDE
#include "trace/vector_loads.glsl"
#include "trace/walk.glsl"
#include "bvh/wide.glsl"
#extension GL_EXT_control_flow_attributes : require

struct WideNode {
    Child child[WIDTH];
};

layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer WideNodes { WideNode node[]; };

WideNode wide_node_at(WideNodes nodes, uint index) {
    if (!IN_VECTORS) return nodes.node[index];
    Quads quads = Quads(uvec2(nodes));
    WideNode node;
    [[unroll]] for (uint i = 0; i < WIDTH; ++i) {
        uint at = 2u * (WIDTH * index + i);
        node.child[i] = child_of_quads(quads.quad[at], quads.quad[at + 1u]);
    }
    return node;
}

// Where the ray enters each child: infinity for those that it does not.
float wide_enter[WIDTH];
uint wide_index[WIDTH];
uint wide_count[WIDTH];

void in_order(uint a, uint b) {
    bool swap = wide_enter[b] < wide_enter[a];
    float enter = wide_enter[a];
    uint index = wide_index[a], count = wide_count[a];
    wide_enter[a] = swap ? wide_enter[b] : enter;
    wide_index[a] = swap ? wide_index[b] : index;
    wide_count[a] = swap ? wide_count[b] : count;
    wide_enter[b] = swap ? enter : wide_enter[b];
    wide_index[b] = swap ? index : wide_index[b];
    wide_count[b] = swap ? count : wide_count[b];
}

// The nearest child is at hand, the others wait.
void go_to_nearest(inout Walk walk) {
    walk.work.x++;
    // Sorting networks.
#if WIDTH == 8
    in_order(0, 1); in_order(2, 3); in_order(4, 5); in_order(6, 7);
    in_order(0, 2); in_order(1, 3); in_order(4, 6); in_order(5, 7);
    in_order(1, 2); in_order(5, 6); in_order(0, 4); in_order(3, 7);
    in_order(1, 5); in_order(2, 6);
    in_order(1, 4); in_order(3, 6);
    in_order(2, 4); in_order(3, 5);
    in_order(3, 4);
#else
    in_order(0, 1); in_order(2, 3);
    in_order(0, 2); in_order(1, 3);
    in_order(1, 2);
#endif
    [[unroll]] for (uint i = WIDTH - 1; i > 0; --i) {
        if (wide_enter[i] < HEDGEROW_INFINITY) {
            hedgerow_put(walk.level, HedgerowWaiting(wide_index[i], wide_count[i], wide_enter[i]));
            walk.level++;
        }
    }
    walk.index = wide_index[0];
    walk.left = wide_enter[0] < HEDGEROW_INFINITY ? wide_count[0] : NOTHING;
    count_leaf(walk);
}

void enter_child(uint i, Child child, Walk walk) {
    bool enters;
    float enter = hedgerow_enter(walk.ray, child.lo, child.hi, walk.best, enters);
    wide_enter[i] = enters && child.count != UNUSED ? enter : HEDGEROW_INFINITY;
    wide_index[i] = child.index;
    wide_count[i] = child.count;
}

void visit_wide(WideNode node, inout Walk walk) {
    // No loop: where shaderc unrolls one, the copies of what is `precise` are not.
#define ENTER_CHILD(i) enter_child(i, node.child[i], walk)
    ENTER_CHILD(0); ENTER_CHILD(1); ENTER_CHILD(2); ENTER_CHILD(3);
#if WIDTH == 8
    ENTER_CHILD(4); ENTER_CHILD(5); ENTER_CHILD(6); ENTER_CHILD(7);
#endif
#undef ENTER_CHILD
    go_to_nearest(walk);
}
#endif
