// The step `records` of bvh/wide/collapse.glsl: the records in leaves, and the table of geometries.
#ifndef HEDGEROW_BVH_WIDE_RECORDS
#define HEDGEROW_BVH_WIDE_RECORDS
#include "bvh/wide/collapse.glsl"

// A triangle to its unit, and with it the second of its pair.
void write_triangle(Triangles given, uvec2 records, uint i) {
    uint partner = partners.word[i];
    if (partner != IS_SECOND) {
        Triangle first = given.triangle[i];
        uint unit = places.word[i];
        if (partner != ALONE) {
            uint order = partner >> 4;
            Triangle second = given.triangle[i + (partner & 15u)];
            vec3 vertex = (order & 3u) == 3u ? second.v0 : (order >> 2 & 3u) == 3u ? second.v1 : second.v2;
            first.primitive |= HAS_SECOND | order << 28;
            SecondsOfPairs(second_at_unit(records, unit)).second[0] = SecondOfPair(vertex, second.primitive | order >> 4 << PRIMITIVE_BITS);
        }
        Triangles(record_at_unit(records, unit)).triangle[0] = first;
    }
}

void write_records() {
    Header from = source.header;
    if (!is_binary(from)) return;
    Header to = Structure(target).header;
    uint bytes_each = record_bytes(from.kind);
    uvec2 records = source_records();
    uvec2 target_records = wide_records_at(target, to.node_slots, wide_node_bytes(WIDTH, QUANTISED));
    if (is_paired()) {
        for (uint k = 0, i = grid_item(0); i < to.primitive_count; i = grid_item(++k)) write_triangle(Triangles(records), target_records, i);
    } else if (QUANTISED) {
        for (uint k = 0, i = grid_item(0); i < to.primitive_count; i = grid_item(++k)) {
            Words given = Words(address_of(records, i, bytes_each));
            Words placed = Words(address_of(target_records, places.word[i], bytes_each));
            for (uint w = 0; w < bytes_each / 4; ++w) placed.word[w] = given.word[w];
        }
    } else {
        copy_bytes(records, target_records, address_of(uvec2(0), to.primitive_count, bytes_each));
    }
    Words given = Words(source_table());
    Words table = Words(address_of(address_of(target_records, to.primitive_count - to.pairs, bytes_each), to.pairs, 16u));
    uint words = to.geometry_count > 1 ? 2 * to.geometry_count : 0;
    for (uint k = 0, i = grid_item(0); i < words; i = grid_item(++k)) table.word[i] = given.word[i];
}
#endif
