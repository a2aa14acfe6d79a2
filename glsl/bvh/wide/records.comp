#version 460
// The records in leaves, and the table of geometries: see bvh/wide/collapse.glsl for the contract.
#include "bvh/wide/collapse.glsl"

void main() {
    Header from = source.header;
    if (!is_binary(from)) return;
    Header to = Structure(target).header;
    uint bytes_each = record_bytes(from.kind);
    uvec2 records = records_at(uvec2(source), from.node_slots);
    uvec2 target_records = wide_records_at(target, to.node_slots, wide_node_bytes(WIDTH, QUANTISED));
    if (QUANTISED) {
        for (uint k = 0, i = grid_item(0); i < to.primitive_count; i = grid_item(++k)) {
            Words given = Words(address_of(records, order.word[i], bytes_each));
            Words placed = Words(address_of(target_records, i, bytes_each));
            for (uint w = 0; w < bytes_each / 4; ++w) placed.word[w] = given.word[w];
        }
    } else {
        copy_bytes(records, target_records, address_of(uvec2(0), to.primitive_count, bytes_each));
    }
    Words given = Words(geometry_table_address(uvec2(source), from.kind, from.node_slots, from.primitive_count));
    Words table = Words(address_of(target_records, to.primitive_count, bytes_each));
    uint words = to.geometry_count > 1 ? 2 * to.geometry_count : 0;
    for (uint k = 0, i = grid_item(0); i < words; i = grid_item(++k)) table.word[i] = given.word[i];
}
