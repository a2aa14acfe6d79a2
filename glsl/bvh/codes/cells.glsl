// The grids of mipping and binning: which cell a primitive is in, and how many are in each.
//
//   count_cells   reads the primitives, state: plan   writes the cells: bits (mipping) or counts (binning), zeroed before
//
// The cells lie in the sort's table, which is not used before the sort.
#ifndef HEDGEROW_BVH_CODE_CELLS
#define HEDGEROW_BVH_CODE_CELLS
#include "bvh/build_state.glsl"

// Words of either grid: 2^12 bits or 2^7 counts.
const uint CELL_WORDS = 128;

shared uint cells_of_task[HAS_GRID ? CELL_WORDS : 1];

// A primitive's coordinates as fractions of 96 bits.
struct WideCoordinates {
    uvec3 axis[3];
};

WideCoordinates wide_coordinates(CodePlan plan, Box b) {
    vec3 at = centroid_of(b);
    WideCoordinates wide;
    for (uint axis = 0; axis < 3; ++axis) wide.axis[axis] = wide_fraction_of(at[axis], plan.axes[axis]);
    return wide;
}

// The cell as the first bits of the code.
uint cell_by_code(CodeKind kind, CodeGrid grid, WideCoordinates wide) {
    uvec3 left = uvec3(wide.axis[0].z, wide.axis[1].z, wide.axis[2].z);
    uint cell = 0;
    for (uint bit = 0; bit < 3 * kind.depth; ++bit) {
        uint axis = grid.axes >> 2 * bit & 3;
        cell = cell << 1 | left[axis] >> 31;
        left[axis] <<= 1;
    }
    return cell;
}

// The cell along each axis.
uvec3 cell_by_axes(CodeGrid grid, WideCoordinates wide) {
    // In two steps, as a shift by 32 is undefined.
    return uvec3(wide.axis[0].z, wide.axis[1].z, wide.axis[2].z) >> 1 >> (31 - grid.bits);
}

uint cell_number(CodeGrid grid, uvec3 cell) {
    uvec3 shifted = cell << grid.shift;
    return shifted.x | shifted.y | shifted.z;
}

void count_cells(uint task) {
    BuildState state = build_state();
    Geometry input_geometries = geometries();
    CodeKind kind = kind_of_codes();
    CodePlan plan = state.plan;
    for (uint word = gl_LocalInvocationIndex; word < CELL_WORDS; word += gl_WorkGroupSize.x) cells_of_task[word] = 0;
    barrier();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint primitive = first + k * gl_WorkGroupSize.x;
        if (primitive < primitive_count) {
            Box b;
            if (load_reference(input_geometries, primitive, b) == 0) {
                WideCoordinates wide = wide_coordinates(plan, b);
                if (CODE_PREFIX == PREFIX_CELLS) {
                    uint cell = cell_by_code(kind, plan.grid, wide);
                    atomicOr(cells_of_task[cell >> 5], 1u << (cell & 31));
                } else {
                    atomicAdd(cells_of_task[cell_number(plan.grid, cell_by_axes(plan.grid, wide))], 1);
                }
            }
        }
    }
    barrier();
    // One atomic a word and task instead of one a primitive.
    Words cells = Words(part(parts.table));
    for (uint word = gl_LocalInvocationIndex; word < CELL_WORDS; word += gl_WorkGroupSize.x) {
        uint found = cells_of_task[word];
        if (found != 0) {
            if (CODE_PREFIX == PREFIX_CELLS) atomicOr(cells.word[word], found);
            else atomicAdd(cells.word[word], found);
        }
    }
}
#endif
