// A step of trace/walk.glsl at a node of WIDTH children as floats: the twin of src/trace/twin/wide.rs, visit for visit.
//
// The children that the ray enters are sorted by where it does; the nearest is at hand then, the others wait, the farthest
// below. So many may wait at once that a shader defines HEDGEROW_LEVELS (src/trace/wide.rs, `Order::stack_levels`).
//
// With LEFT_FIRST, for rays that end at any hit, they are met by slots instead: that in the lowest one is at hand, and which others the
// ray enters is a mask of bits beside their node. When the ray goes down, those two words wait: one entry a level, and nothing to sort.
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
    WideNode node;
#ifdef HEDGEROW_INT64
    HedgerowLongs longs = HedgerowLongs(address_of(uvec2(nodes), index, 32u * WIDTH));
    [[unroll]] for (uint i = 0; i < WIDTH; ++i) {
        node.child[i] = child_of_quads(hedgerow_quad_of(longs, 4u * i), hedgerow_quad_of(longs, 4u * i + 2u));
    }
#else
    if (!IN_VECTORS) return nodes.node[index];
    Quads quads = Quads(uvec2(nodes));
    [[unroll]] for (uint i = 0; i < WIDTH; ++i) {
        uint at = 2u * (WIDTH * index + i);
        node.child[i] = child_of_quads(quads.quad[at], quads.quad[at + 1u]);
    }
#endif
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

// LEFT_FIRST: the node whose children are looked into one after the other, and the slots of those that are left. A shader sets the latter
// to 0 where a ray begins.
uint wide_node;
uint wide_rest;

// The child in the lowest slot is at hand. What was left of the node above waits.
void go_to_leftmost(inout Walk walk) {
    walk.work.x++;
    if (wide_rest != 0u) {
        hedgerow_put_entry(walk.level, uvec2(wide_node, wide_rest));
        walk.level++;
    }
    wide_node = walk.index;
    wide_rest = 0u;
    walk.left = NOTHING;
    [[unroll]] for (uint i = WIDTH; i-- > 0;) {
        bool enters = wide_enter[i] < HEDGEROW_INFINITY;
        walk.index = enters ? wide_index[i] : walk.index;
        walk.left = enters ? wide_count[i] : walk.left;
        wide_rest |= enters ? 1u << i : 0u;
    }
    wide_rest &= wide_rest - 1u;
    count_leaf(walk);
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

void go_to_first(inout Walk walk) {
    if (LEFT_FIRST) go_to_leftmost(walk);
    else go_to_nearest(walk);
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
    go_to_first(walk);
}

// Index and count of the child in a slot.
uvec2 wide_child_in_slot(WideNodes nodes, uint node, uint slot) {
    return uvec2(nodes.node[node].child[slot].index, nodes.node[node].child[slot].count);
}
#endif
