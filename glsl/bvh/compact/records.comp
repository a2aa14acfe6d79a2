#version 460
// The records of the tree and what lies behind them: see bvh/compact.glsl for the contract.
#include "bvh/compact.glsl"

void main() {
    Header from = source.header;
    if (!is_binary(from)) return;
    Header to = compacted(from);
    uvec2 bytes = address_of(uvec2(0), to.primitive_count, record_bytes(to.kind));
    copy_bytes(records_at(uvec2(source), from.node_slots), records_at(uvec2(target), to.node_slots), bytes);
    // The table begins behind records of 28 or 40 bytes: at a multiple of 4.
    Words given = Words(geometry_table_of(uvec2(source), from));
    Words table = Words(geometry_table_of(uvec2(target), to));
    uint words = to.geometry_count > 1 ? 2 * to.geometry_count : 0;
    // Or the boxes of what is far, in a top level.
    if (to.near_node != 0) words = FAR_SIDES * FAR_BOX_BYTES / 4;
    for (uint k = 0, i = grid_item(0); i < words; i = grid_item(++k)) table.word[i] = given.word[i];
}
