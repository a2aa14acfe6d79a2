#version 460
// What the boxes at links cost by rays and area, and what a ray weighs: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion.glsl"

// The first 24 bits of a sum of 64 that is not 0: exact, whatever a device rounds.
float leading(uint at, float unit) {
    uint low = totals.word[at], high = totals.word[at + 1u];
    int shift = high != 0u ? 32 + findMSB(high) - 23 : findMSB(low) - 23;
    uint bits = shift <= 0 ? low : shift < 32 ? low >> shift | (high << (31 - shift)) << 1 : high >> (shift - 32);
    precise float leads = float(bits) * unit;
    return shift <= 0 ? leads : leads * uintBitsToFloat(uint(127 + shift) << 23);
}

// What the area of all nodes is to the rays that meet them, times what rays weigh. Without rays or area nothing.
float weighed_ratio() {
    uint area = totals.word[TOTALS_AREA] | totals.word[TOTALS_AREA + 1u];
    uint rays = totals.word[TOTALS_RAYS] | totals.word[TOTALS_RAYS + 1u];
    if (area == 0u || rays == 0u || by_rays == 0.0) return 0.0;
    precise float weighed = by_rays * leading(TOTALS_AREA, 5.9604644775390625e-8);
    return flux_quotient(weighed, leading(TOTALS_RAYS, 0.00390625));
}

void main() {
    float of_rays = weighed_ratio(), scale = structure.header.area_scale;
    if (grid_item(0) == 0u) {
        totals.word[TOTALS_RATIO] = floatBitsToUint(of_rays);
        uint root = min(structure.header.root.index, link_count / 2u - 1u);
        totals.word[TOTALS_ROOT] = floatBitsToUint(is_used(root) ? cost_of(box_of_node(root), scale, of_rays) : 0.0);
    }
    for (uint k = 0, link = grid_item(0); link < link_count; link = grid_item(++k)) {
        if (!is_used(link >> 1)) continue;
        costs.value[link] = cost_of(box_of(child_at(link)), scale, of_rays);
    }
}
