#version 460
// Every node to its index, and the header: see bvh/compact.glsl for the contract.
#include "bvh/compact.glsl"

void main() {
    Header header = source.header;
    if (!is_structure(header)) {
        write_wrong_version(target);
        return;
    }
    if (is_quantised(header.kind)) {
        copy_bytes(uvec2(source), uvec2(target), structure_bytes(header));
        return;
    }
    if (invocation_number() == 0) {
        target.header = compacted(header);
        if (compacted(header).inner_nodes == 0) mark_unused(target, 0);
    }
    uint slots = slots_to_see(header);
    Places places = places_of(header);
    for (uint k = 0, slot = grid_item(0); slot < slots; slot = grid_item(++k)) {
        if (source.nodes[slot].left.count == UNUSED) continue;
        uint index = 0, at = slot;
        for (uint level = 0; (places.place[at].size & INDEX) == 0u && level < MAX_DEPTH; ++level) index += climb(places, at);
        index += places.place[at].size & ~INDEX;
        Node node = source.nodes[slot];
        if (is_node(node.left)) node.left.index = index + 1;
        if (is_node(node.right)) node.right.index = index + 1 + places.place[slot].left;
        target.nodes[index] = node;
    }
}
