#version 460
// The parent of every node, and which have no node below them: see bvh/compact.glsl for the contract.
#include "bvh/compact.glsl"

void main() {
    Header header = source.header;
    uint slots = slots_to_see(header);
    Places places = places_of(header);
    for (uint k = 0, slot = grid_item(0); slot < slots; slot = grid_item(++k)) {
        Child left = source.nodes[slot].left, right = source.nodes[slot].right;
        bool is_used = left.count != UNUSED;
        bool left_is_node = is_used && is_node(left), right_is_node = is_used && is_node(right);
        places.place[slot].left = 0;
        places.place[slot].size = 0;
        places.place[slot].is_lowest = is_used && !left_is_node && !right_is_node ? 1 : 0;
        uint both = left_is_node && right_is_node ? HAS_SIBLING : 0;
        if (left_is_node) places.place[left.index].up = slot << 2 | both;
        if (right_is_node) places.place[right.index].up = slot << 2 | both | IS_RIGHT;
    }
}
