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

// Which slots of a wide node hold leaves.
uint leaves_of(uint at) {
    uint leaves = 0;
    NextSlots all = slots_of(at);
    for (uint s = 0; s < WIDTH; ++s) leaves |= (is_leaf_in(take_slot(all)) ? 1u : 0u) << s;
    return leaves;
}

uint take_lowest(inout uint mask) {
    uint lowest = uint(findLSB(mask));
    mask &= mask - 1u;
    return lowest;
}

// Looks through the leaves of a wide node: how many units they take. One loop over all of them, in which a turn looks at one triangle beside
// another: in a loop for each leaf all lanes would wait for the longest.
uint pair_leaves(uint at) {
    Triangles triangles = Triangles(source_records());
    uint units = 0, leaves = leaves_of(at), record = 0, end = 0, other = 0, window_end = 0;
    // Bit 0: this record is the second of a pair; bits above it: those behind it.
    uint seconds = 0;
    Triangle first;
    while (record < end || leaves != 0u) {
        if (record >= end) {
            Child leaf = child_in(word_of_slot(at, take_lowest(leaves)));
            record = leaf.index;
            end = end_of_leaf(leaf);
            seconds = 0;
            other = record;
        }
        if (record < end && other <= record) {
            units += UNITS_OF_ONE;
            other = record + 1;
            window_end = min(record + WINDOW + 1, end);
            // The last one has nothing behind it, and is not looked at.
            if (other < window_end) first = triangles.triangle[record];
        }
        uint partner = ALONE;
        if (other < window_end) {
            uint order = (seconds >> other - record & 1u) == 0u ? order_of(first, triangles.triangle[other]) : 0u;
            if (order != 0u) {
                partner = other - record | order << 4;
                partners.word[other] = IS_SECOND;
                seconds |= 1u << other - record;
                units += UNITS_OF_TWO - UNITS_OF_ONE;
            }
            other++;
        }
        if (record < end && (partner != ALONE || other >= window_end)) {
            partners.word[record] = partner;
            // On to the next that is not a second.
            uint next = uint(findLSB(~(seconds >> 1))) + 1u;
            record += next;
            seconds >>= next;
            other = record;
        }
    }
    return units;
}

void find_pairs() {
    if (!is_paired() || !can_be_collapsed(source.header)) return;
    uint count = levels.end;
    for (uint k = 0, at = grid_item(0); at < count; at = grid_item(++k)) note_units(opened.node[at].slot, pair_leaves(at));
}
#endif
