// Binning (Riemersma 2024, 3.2.3 and 8.2): src/bvh/codes/binning.rs explains it and is the twin.
//
//   find_splits   reads the counts of cells, state: plan; one workgroup   writes the parts behind them, and of each cell its part
//   bin_parts     of one primitive
#ifndef HEDGEROW_BVH_CODE_BINNING
#define HEDGEROW_BVH_CODE_BINNING
#include "bvh/codes/scores.glsl"

const uint PARTS_AT_MOST = 64;

// A part of the grid and the code within it: `Part` in binning.rs.
struct CodePart {
    uint path;
    uint path_bits;
    uvec3 first;
    uvec3 last;
    Stretches stretches;
};
BUFFER CodeSplits {
    uint part_of[CELLS];
    CodePart part[PARTS_AT_MOST];
};

// The parts before and behind a level of splits in turn, their corners packed in bytes, and the candidates for their splits: at
// most one fewer than cells.
shared uint part_count;
shared uint part_first[HAS_SPLITS ? 2 * PARTS_AT_MOST : 1];
shared uint part_last[HAS_SPLITS ? 2 * PARTS_AT_MOST : 1];
shared uint part_path[HAS_SPLITS ? 2 * PARTS_AT_MOST : 1];
shared uint part_path_bits[HAS_SPLITS ? 2 * PARTS_AT_MOST : 1];
shared uint first_candidate[HAS_SPLITS ? PARTS_AT_MOST + 1 : 1];
shared uvec2 scores[HAS_SPLITS ? CELLS : 1];

uint parts_at(uint level) {
    return (level & 1) * PARTS_AT_MOST;
}

uvec3 unpack_cell(uint packed) {
    return uvec3(packed, packed >> 8, packed >> 16) & 0xFFu;
}

uint pack_cell(uvec3 cell) {
    return cell.x | cell.y << 8 | cell.z << 16;
}

// The plane of a candidate for the split of a part: x is the axis, y the first cell behind the plane.
uvec2 plane_of(uvec3 first, uvec3 last, uint candidate) {
    for (uint axis = 0; axis < 2; ++axis) {
        uint planes = last[axis] - first[axis];
        if (candidate < planes) return uvec2(axis, first[axis] + 1 + candidate);
        candidate -= planes;
    }
    return uvec2(2, first.z + 1 + candidate);
}

// One level of splits: candidates are numbered through all parts, so that a free invocation takes the next.
void split_parts(CodeKind kind, CodeGrid grid, uint level) {
    uint parts = part_count;
    uint from = parts_at(level), to = parts_at(level + 1);
    if (gl_LocalInvocationIndex == 0) {
        uint candidates = 0;
        for (uint part = 0; part < parts; ++part) {
            first_candidate[part] = candidates;
            uvec3 planes = unpack_cell(part_last[from + part]) - unpack_cell(part_first[from + part]);
            candidates += planes.x + planes.y + planes.z;
        }
        first_candidate[parts] = candidates;
    }
    barrier();
    for (uint candidate = gl_LocalInvocationIndex; candidate < first_candidate[parts]; candidate += gl_WorkGroupSize.x) {
        uint part = 0;
        while (part + 1 < parts && first_candidate[part + 1] <= candidate) part++;
        uvec3 first = unpack_cell(part_first[from + part]), last = unpack_cell(part_last[from + part]);
        uvec2 plane = plane_of(first, last, candidate - first_candidate[part]);
        scores[candidate] = score_of(kind, grid, first, last, plane.x, plane.y);
    }
    barrier();
    // A side of a part is a lane's. Each part that is split before it moves it up by one; the parts so far are read from elsewhere.
    for (uint item = gl_LocalInvocationIndex; item < 2 * parts; item += gl_WorkGroupSize.x) {
        uint part = item / 2, side = item % 2;
        uint best = first_candidate[part], end = first_candidate[part + 1];
        bool is_split = best < end;
        uint place = part;
        for (uint before = 0; before < part; ++before) place += first_candidate[before + 1] > first_candidate[before] ? 1 : 0;
        if (is_split || side == 0) {
            uvec3 first = unpack_cell(part_first[from + part]), last = unpack_cell(part_last[from + part]);
            uint path = part_path[from + part];
            if (is_split) {
                for (uint other = best + 1; other < end; ++other) {
                    if (is_below(scores[other], scores[best])) best = other;
                }
                uvec2 plane = plane_of(first, last, best - first_candidate[part]);
                if (side == 0) last[plane.x] = plane.y - 1;
                else first[plane.x] = plane.y;
                tighten(grid, 0, first, last);
                path = path << 1 | side;
                place += side;
            }
            part_first[to + place] = pack_cell(first);
            part_last[to + place] = pack_cell(last);
            part_path[to + place] = path;
            part_path_bits[to + place] = part_path_bits[from + part] + (is_split ? 1 : 0);
            if (part + 1 == parts) atomicMax(part_count, place + 1);
        }
    }
    barrier();
}

// The extents of a box of these numbers of cells: `Extents::times` in recipe.rs.
ivec3 extents_of_cells(CodeGrid grid, uvec3 cells) {
    ivec3 extents;
    for (uint axis = 0; axis < 3; ++axis) {
        uint product = (uint(grid.extents[axis]) & 0x7FFFFFu | 0x800000u) * cells[axis];
        uint more = uint(findMSB(product)) - 23;
        extents[axis] = (grid.extents[axis] >> 23) + int(more) << 23 | int(product >> more & 0x7FFFFFu);
    }
    return extents;
}

void find_splits() {
    BuildState state = build_state();
    if (state.active_count == 0) return;
    CodeKind kind = kind_of_codes();
    CodeGrid grid = state.plan.grid;
    find_bitmaps(kind.count_bits);
    if (gl_LocalInvocationIndex == 0) {
        uvec3 first = uvec3(0), last = (uvec3(1) << grid.bits) - 1;
        tighten(grid, 0, first, last);
        part_count = 1;
        part_first[0] = pack_cell(first);
        part_last[0] = pack_cell(last);
        part_path[0] = 0;
        part_path_bits[0] = 0;
    }
    barrier();
    for (uint level = 0; level < 2 * kind.depth; ++level) split_parts(kind, grid, level);

    CodeSplits splits = CodeSplits(part(parts.table));
    for (uint part = gl_LocalInvocationIndex; part < part_count; part += gl_WorkGroupSize.x) {
        uvec3 first = unpack_cell(part_first[part]), last = unpack_cell(part_last[part]);
        ivec3 extents = extents_of_cells(grid, last - first + 1);
        Stretches stretches = find_stretches(ORDER_VARIABLE, extents, kind.bits);
        splits.part[part] = CodePart(part_path[part], part_path_bits[part], first, last, stretches);
    }
    for (uint cell = gl_LocalInvocationIndex; cell < CELLS; cell += gl_WorkGroupSize.x) {
        uvec3 at = uvec3(cell) >> grid.shift & (uvec3(1) << grid.bits) - 1;
        uint holds = 0;
        for (uint part = 0; part < part_count; ++part) {
            bool is_in = all(greaterThanEqual(at, unpack_cell(part_first[part])))
                      && all(lessThanEqual(at, unpack_cell(part_last[part])));
            if (is_in) holds = part;
        }
        splits.part_of[cell] = holds;
    }
}

// The first 64 of the 96 bits of v / divisor << shift, for v < divisor << (96 − shift).
uvec2 divide_and_shift(uvec3 v, uint divisor, uint shift) {
    uint remainder = 0;
    uvec3 quotient = uvec3(0);
    for (uint k = 0; k < 6; ++k) {
        uint word = 2 - k / 2;
        uint half_word = (k & 1) == 0 ? v[word] >> 16 : v[word] & 0xFFFFu;
        uint dividend = remainder << 16 | half_word;
        quotient[word] = quotient[word] << 16 | dividend / divisor;
        remainder = dividend % divisor;
    }
    return shift_left(quotient, shift).yz;
}

CodeParts bin_parts(CodeKind kind, CodePlan plan, Box b) {
    CodeSplits splits = CodeSplits(part(parts.table));
    WideCoordinates wide = wide_coordinates(plan, b);
    CodePart part = splits.part[splits.part_of[cell_number(plan.grid, cell_by_axes(plan.grid, wide))]];
    CodeParts parts;
    for (uint axis = 0; axis < 3; ++axis) {
        // Where it lies in the part, as a fraction of it; in two steps, as a shift by 32 is undefined.
        uvec3 from_first = wide.axis[axis];
        from_first.z -= part.first[axis] << 1 << (31 - plan.grid.bits[axis]);
        parts.coordinates[axis] = divide_and_shift(from_first, part.last[axis] - part.first[axis] + 1, plan.grid.bits[axis]);
    }
    parts.stretches = part.stretches;
    parts.size = 0;
    parts.section = 0;
    parts.prefix = part.path;
    parts.prefix_bits = part.path_bits;
    return parts;
}
#endif
