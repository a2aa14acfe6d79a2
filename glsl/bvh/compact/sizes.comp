#version 460
// How many nodes each subtree has, bottom-up: see bvh/compact.glsl for the contract.
//
// Of two subtrees the second to be done goes on with their parent. The size of the first travels in the atomic itself, so that
// nothing else need be visible.
#include "bvh/compact.glsl"

// From a node of two leaves up to the root, or to where the sibling is not done.
void sum(Places places, uint root, uint slot) {
    uint size = 1;
    for (uint level = 0; slot != root && level < MAX_DEPTH; ++level) {
        uint up = places.place[slot].up, parent = up >> 2;
        uint other = 0;
        if ((up & HAS_SIBLING) != 0u) {
            other = atomicExchange(places.place[parent].size, size);
            if (other == 0) return;
            places.place[parent].left = (up & IS_RIGHT) != 0u ? other : size;
        }
        size += 1 + other;
        // The sibling may have come by: atomic, as its exchange was.
        atomicStore(places.place[parent].size, size, gl_ScopeDevice, 0, 0);
        slot = parent;
    }
}

void main() {
    Header header = source.header;
    uint slots = slots_to_see(header);
    Places places = places_of(header);
    for (uint k = 0, slot = grid_item(0); slot < slots; slot = grid_item(++k)) {
        if (places.place[slot].is_lowest != 0) sum(places, header.root.index, slot);
    }
}
