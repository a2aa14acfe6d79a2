#version 460
// Area and rays of all nodes, in whole numbers: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion.glsl"

// Areas are 48 at most, the scene's longest edge being 1 to 4, but for what is far from where most is; rays of a box 8 times those of the grid.
const float PARTS_OF_AREA = 16777216.0;   // 2^24
const float PARTS_OF_RAYS = 256.0;
// What is larger counts as this, and so fits 32 bits.
const float MOST_AREA = 255.0;

void main() {
    Sum64 area = Sum64(0u, 0u), rays = Sum64(0u, 0u);
    float scale = structure.header.area_scale;
    for (uint k = 0, slot = grid_item(0); slot < link_count / 2u; slot = grid_item(++k)) {
        if (!is_used(slot)) continue;
        Box b = box_of_node(slot);
        add_to(area, uint(min(scaled_half_area(b, scale), MOST_AREA) * PARTS_OF_AREA));
        add_to(rays, uint(flux_of(grid, b) * PARTS_OF_RAYS));
    }
    add_to_words(totals, TOTALS_AREA, area);
    add_to_words(totals, TOTALS_RAYS, rays);
}
