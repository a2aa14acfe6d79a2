// The step `pair` of bvh/wide/collapse.glsl: finds triangles in leaves that share an edge. src/bvh/wide/pairs.rs has the rule.
#ifndef HEDGEROW_BVH_WIDE_PAIR
#define HEDGEROW_BVH_WIDE_PAIR
#include "bvh/wide/collapse.glsl"

// How many of the records behind it may be a record's partner.
const uint WINDOW = 8;

uvec3 bits_of(vec3 vertex) {
    return floatBitsToUint(vertex);
}

// Which vertex of a triangle this is, or 3.
uint found_in(Triangle first, vec3 vertex) {
    uvec3 bits = bits_of(vertex);
    return bits == bits_of(first.v0) ? 0 : bits == bits_of(first.v1) ? 1 : bits == bits_of(first.v2) ? 2 : 3;
}

// Which of four vertices the second triangle has, two bits each; 0 if the two share no edge.
uint order_of(Triangle first, Triangle second) {
    uvec3 found = uvec3(found_in(first, second.v0), found_in(first, second.v1), found_in(first, second.v2));
    // Of several that may be the new one the first, as two triangles may be the same.
    bool has_x = found.x != 3, has_y = found.y != 3, has_z = found.z != 3;
    uint order = has_y && has_z ? found.y << 2 | found.z << 4 | 3u : found.x | 3u << 2 | found.z << 4;
    if (has_x && !has_z) order = found.x | found.y << 2 | 3u << 4;
    return uint(has_x) + uint(has_y) + uint(has_z) < 2u ? 0 : order;
}

// The pairs of a leaf: how many units it takes.
uint pair_leaf(Child leaf) {
    Triangles triangles = Triangles(source_records());
    uint units = 0, end = min(leaf.index + leaf.count, source.header.primitive_count);
    // Bit 0: this record is the second of a pair; bits above it: those behind it.
    uint seconds = 0;
    for (uint r = leaf.index; r < end; ++r, seconds >>= 1) {
        if ((seconds & 1u) != 0u) continue;
        uint partner = ALONE, window_end = min(r + WINDOW + 1, end);
        units += UNITS_OF_ONE;
        // The last one has nothing behind it, and is not looked at.
        if (r + 1 < window_end) {
            Triangle first = triangles.triangle[r];
            for (uint other = r + 1; other < window_end; ++other) {
                if ((seconds >> other - r & 1u) != 0u) continue;
                uint order = order_of(first, triangles.triangle[other]);
                if (order == 0) continue;
                partner = other - r | order << 4;
                partners.word[other] = IS_SECOND;
                seconds |= 1u << other - r;
                units += UNITS_OF_TWO - UNITS_OF_ONE;
                break;
            }
        }
        partners.word[r] = partner;
    }
    return units;
}

void find_pairs() {
    if (!is_paired() || !can_be_collapsed(source.header)) return;
    uint count = levels.end;
    for (uint k = 0, at = grid_item(0); at < count; at = grid_item(++k)) {
        uint units = 0;
        for (uint s = 0; s < WIDTH; ++s) {
            uint name = slots.word[at * WIDTH + s];
            if (name == NO_CHILD) continue;
            Child child = child_named(name);
            if (!is_inner(child)) units += pair_leaf(child);
        }
        first_records.word[opened.node[at].slot] = units;
    }
}
#endif
