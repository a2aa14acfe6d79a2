#version 460
// Whether a tree is deeper than tracers can walk: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion.glsl"

void main() {
    Child root = structure.header.root;
    for (uint k = 0, slot = grid_item(0); slot < link_count / 2u; slot = grid_item(++k)) {
        if (!is_used(slot)) continue;
        // Its children are one level below it.
        uint depth = 1, at = slot;
        for (; depth < MAX_DEPTH && at != root.index; ++depth) at = above(at);
        if (at != root.index) atomicOr(structure.header.status, STATUS_TOO_DEEP);
    }
}
