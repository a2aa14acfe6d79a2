// Mipping (Riemersma 2024, 3.2.2 and 8.1): src/bvh/codes/mipping.rs explains it and is the twin.
//
//   find_layers   reads the cells; one workgroup   writes the mip layers behind them
//   mip_parts     of one primitive
#ifndef HEDGEROW_BVH_CODE_MIPPING
#define HEDGEROW_BVH_CODE_MIPPING
#include "bvh/codes/cells.glsl"

// Words of the layer with 8^layer cells.
uint layer_words(uint layer) {
    return max(1u << 3 * layer >> 5, 1u);
}

// Where a layer begins: the cells are the last layer and come first.
uint layer_at(uint layer, uint depth) {
    uint at = 0;
    for (uint other = depth; other > layer; --other) at += layer_words(other);
    return at;
}

// A bit for each byte that has any: four of them.
uint any_of_bytes(uint word) {
    word |= word >> 4;
    word |= word >> 2;
    word |= word >> 1;
    word &= 0x01010101u;
    return (word | word >> 7 | word >> 14 | word >> 21) & 0xFu;
}

void find_layers() {
    Words cells = Words(part(parts.table));
    uint depth = kind_of_codes().depth;
    for (uint layer = depth - 1; layer > 0; --layer) {
        uint from = layer_at(layer + 1, depth), to = layer_at(layer, depth);
        uint words = layer_words(layer + 1);
        for (uint word = gl_LocalInvocationIndex; word < layer_words(layer); word += gl_WorkGroupSize.x) {
            uint merged = 0;
            for (uint k = 0; k < min(words, 8); ++k) merged |= any_of_bytes(cells.word[from + 8 * word + k]) << 4 * k;
            cells.word[to + word] = merged;
        }
        next_phase();
    }
}

// The bits of a cell that distinguish occupied cells: x is their number, y how many they are.
uvec2 concise_index(uint depth, uint cell) {
    Words cells = Words(part(parts.table));
    uint index = 0, count = 0;
    for (uint layer = 1; layer <= depth; ++layer) {
        uint here = cell >> 3 * (depth - layer);
        uint occupied = cells.word[layer_at(layer, depth) + (here >> 5)] >> (here & 24) & 0xFFu;
        // What the table of 256 says of the three splits on the way to this cell of eight: something on both sides.
        for (uint bit = 3; bit > 0; --bit) {
            uint cells_of_half = 1u << (bit - 1);
            uint half_of_it = (1u << cells_of_half) - 1;
            uint begin = here & 7 & ~(2 * cells_of_half - 1);
            if ((occupied >> begin & half_of_it) != 0 && (occupied >> (begin + cells_of_half) & half_of_it) != 0) {
                index = index << 1 | here >> (bit - 1) & 1;
                count += 1;
            }
        }
    }
    return uvec2(index, count);
}

CodeParts mip_parts(CodeKind kind, CodePlan plan, Box b) {
    WideCoordinates wide = wide_coordinates(plan, b);
    uvec2 concise = concise_index(kind.depth, cell_by_code(kind, plan.grid, wide));
    CodeParts parts;
    for (uint axis = 0; axis < 3; ++axis) {
        parts.coordinates[axis] = shift_left(wide.axis[axis], plan.grid.bits[axis]).yz;
    }
    parts.stretches = plan.stretches;
    parts.size = 0;
    parts.section = 0;
    parts.prefix = concise.x;
    parts.prefix_bits = concise.y;
    return parts;
}
#endif
