// The counts of binning's cells as bitmaps, and by them the scores of splits (Riemersma 2024, equations 9 to 11).
//
// A set of cells is a mask of 128 bits; the layout s-m-l makes that of a box from three masks of equal runs.
//
//   find_bitmaps   reads the counts; one workgroup   writes shared memory
//   score_of       reads shared memory
#ifndef HEDGEROW_BVH_CODE_SCORES
#define HEDGEROW_BVH_CODE_SCORES
#include "bvh/codes/cells.glsl"

const uint CELLS = 1 << BINNING_BITS;
const bool HAS_SPLITS = CODE_PREFIX == PREFIX_SPLITS;

// The least and the largest count.
shared uint count_range[2];
// Which cells are occupied, and the bits of their counts as fractions.
shared uvec4 bitmaps[HAS_SPLITS ? 10 : 1];
shared uint cell_values[HAS_SPLITS ? CELLS : 1];
// The counts as bitmaps.
void find_bitmaps(uint count_bits) {
    Words cells = Words(part(parts.table));
    if (gl_LocalInvocationIndex == 0) {
        count_range[0] = NONE;
        count_range[1] = 1;
    }
    barrier();
    for (uint cell = gl_LocalInvocationIndex; cell < CELLS; cell += gl_WorkGroupSize.x) {
        uint count = cells.word[cell];
        if (count != 0) {
            atomicMin(count_range[0], count);
            atomicMax(count_range[1], count);
        }
    }
    barrier();
    uint least = min(count_range[0], count_range[1]), range = count_range[1] - least + 1;
    for (uint cell = gl_LocalInvocationIndex; cell < CELLS; cell += gl_WorkGroupSize.x) {
        uint count = cells.word[cell];
        uint left = count - min(count, least), value = 0;
        for (uint bit = 0; bit < count_bits; ++bit) {
            left <<= 1;
            value <<= 1;
            if (left >= range) {
                left -= range;
                value |= 1;
            }
        }
        cell_values[cell] = value << 1 | (count != 0 ? 1 : 0);
    }
    barrier();
    for (uint word = gl_LocalInvocationIndex; word < 4 * (1 + count_bits); word += gl_WorkGroupSize.x) {
        uint bits = 0;
        for (uint k = 0; k < 32; ++k) bits |= (cell_values[32 * (word & 3) + k] >> (word >> 2) & 1) << k;
        bitmaps[word >> 2][word & 3] = bits;
    }
    barrier();
}

// The cells first..=last along an axis.
uvec4 slab_mask(CodeGrid grid, uint axis, uint first, uint last) {
    uint period = 1u << (grid.shift[axis] + grid.bits[axis]);
    uint begin = first << grid.shift[axis], end = (last + 1) << grid.shift[axis];
    uvec4 mask;
    for (uint word = 0; word < 4; ++word) {
        // A run each period, of which a word has a part, or several.
        int at = int(32 * word & (period - 1));
        uint low = uint(clamp(int(begin) - at, 0, 32)), high = uint(clamp(int(end) - at, 0, 32));
        uint bits = high > low ? 0xFFFFFFFFu >> (32 - (high - low)) << (low & 31) : 0;
        for (uint k = period; k < 32; k <<= 1) bits |= bits << k;
        mask[word] = bits;
    }
    return mask;
}

uvec4 box_mask(CodeGrid grid, uvec3 first, uvec3 last) {
    uvec4 mask = slab_mask(grid, 0, first.x, last.x);
    for (uint axis = 1; axis < 3; ++axis) mask &= slab_mask(grid, axis, first[axis], last[axis]);
    return mask;
}

uint count_bits_of(uvec4 mask) {
    uvec4 counts = uvec4(bitCount(mask));
    return counts.x + counts.y + counts.z + counts.w;
}

// The weight of the cells in a box, whose corners become those of the smallest box around what is occupied there.
uint tighten(CodeGrid grid, uint count_bits, inout uvec3 first, inout uvec3 last) {
    uvec4 mask = box_mask(grid, first, last) & bitmaps[0];
    uint weight = count_bits_of(mask);
    for (uint bit = 0; bit < count_bits; ++bit) weight += count_bits_of(mask & bitmaps[1 + bit]) << bit;
    for (uint axis = 0; axis < 3; ++axis) {
        // The first plane below which there is something; then the last at which there is something.
        uint from = first[axis], to = last[axis];
        for (uint round = 0; round < BINNING_BITS && from < to; ++round) {
            uint middle = (from + to) / 2;
            bool is_there = (mask & slab_mask(grid, axis, first[axis], middle)) != uvec4(0);
            if (is_there) to = middle;
            else from = middle + 1;
        }
        uint lowest = from;
        to = last[axis];
        for (uint round = 0; round < BINNING_BITS && from < to; ++round) {
            uint middle = (from + to + 1) / 2;
            bool is_there = (mask & slab_mask(grid, axis, middle, last[axis])) != uvec4(0);
            if (is_there) from = middle;
            else to = middle - 1;
        }
        first[axis] = lowest;
        last[axis] = from;
    }
    return weight;
}

// Edge of a cell along each axis, of 255.
uvec3 cell_edges(CodeGrid grid) {
    int top = grid.extents[longest_axis(grid.extents)] >> 23;
    uvec3 mantissa = uvec3(grid.extents) & 0x7FFFFFu | 0x800000u;
    return mantissa >> uvec3(min(16 + top - (grid.extents >> 23), ivec3(31)));
}

uint half_area(uvec3 lengths) {
    return lengths.x * lengths.y + lengths.y * lengths.z + lengths.z * lengths.x;
}

// Equation 9, of 256.
uint stretch_factor(uvec3 lengths) {
    uint most = max(max(lengths.x, lengths.y), max(lengths.z, 1));
    uint least = min(min(lengths.x, lengths.y), lengths.z);
    return ((most - min(least, most)) << 8) / most;
}

// Equation 11 times 1/λ, the weight and the area of the part that is split.
uvec2 score_of(CodeKind kind, CodeGrid grid, uvec3 first, uvec3 last, uint axis, uint plane) {
    uvec3 edges = cell_edges(grid);
    uvec2 sah = uvec2(0);
    uint factors = 0;
    for (uint side = 0; side < 2; ++side) {
        uvec3 low = first, high = last;
        if (side == 0) high[axis] = plane - 1;
        else low[axis] = plane;
        uint weight = tighten(grid, kind.count_bits, low, high);
        uvec3 lengths = (high - low + 1) * edges;
        sah = add(sah, multiply(uvec2(weight, 0), uvec2(half_area(lengths), 0)).xy);
        factors += stretch_factor(lengths);
    }
    uvec3 low = first, high = last;
    uint weight = tighten(grid, kind.count_bits, low, high);
    uvec2 whole = multiply(uvec2(weight, 0), uvec2(half_area((high - low + 1) * edges), 0)).xy;
    uvec2 stretched = shift_right(multiply(whole, uvec2(factors, 0)).xy, 8);
    return add(multiply(sah, uvec2(kind.stretch - 1, 0)).xy, stretched);
}
#endif
