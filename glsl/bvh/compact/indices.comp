#version 460
// The indices of the roots of large subtrees, and of the tree's: see bvh/compact.glsl for the contract.
#include "bvh/compact.glsl"

void main() {
    Header header = source.header;
    uint slots = slots_to_see(header);
    Places places = places_of(header);
    for (uint k = 0, slot = grid_item(0); slot < slots; slot = grid_item(++k)) {
        if (places.place[slot].size < LARGE && slot != header.root.index) continue;
        uint index = 0, at = slot;
        for (uint level = 0; at != header.root.index && level < MAX_DEPTH; ++level) index += climb(places, at);
        places.place[slot].size = INDEX | index;
    }
}
