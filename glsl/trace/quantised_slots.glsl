// What is in a slot of a quantised node: src/bvh/wide/quantised.rs, `QuantisedNode::index` and `count`.
#ifndef HEDGEROW_TRACE_QUANTISED_SLOTS
#define HEDGEROW_TRACE_QUANTISED_SLOTS

// Of the eight bytes of both words that of a slot.
uint byte_of_slot(uvec2 bytes, uint slot) {
    return (slot < 4u ? bytes.x : bytes.y) >> ((slot & 3u) * 8u) & 0xFFu;
}

// The sum of the bytes of both words that are below that of a slot.
uint sum_below(uvec2 bytes, uint slot) {
    uint shift = (slot & 3u) * 8;
    uint below = (1u << shift) - 1u;
    uvec2 words = slot < 4 ? uvec2(bytes.x & below, 0u) : uvec2(bytes.x, bytes.y & below);
    uvec2 halves = (words & 0x00FF00FFu) + (words >> 8 & 0x00FF00FFu);
    uint sum = halves.x + halves.y;
    return (sum & 0xFFFFu) + (sum >> 16);
}

// Which of the nodes of its parent the one in a slot is, by a mask of the slots that are nodes.
uint rank_of_node(uint nodes, uint slot) {
    return uint(bitCount(nodes & (1u << slot) - 1u));
}

// A mask of slots as one of places, or back: the bit of slot s goes to place s ^ octant.
uint in_octant(uint mask, uint octant) {
    if ((octant & 1u) != 0u) mask = mask >> 1 & 0x55u | mask << 1 & 0xAAu;
    if ((octant & 2u) != 0u) mask = mask >> 2 & 0x33u | mask << 2 & 0xCCu;
    if ((octant & 4u) != 0u) mask = mask >> 4 & 0x0Fu | mask << 4 & 0xF0u;
    return mask;
}

// The leading half of a float that is not above `enter`.
uint leading_half(float enter) {
    return enter >= 0.0 ? floatBitsToUint(enter) & 0xFFFF0000u : 0xFF800000u;
}
#endif
