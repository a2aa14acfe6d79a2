// Rays on a grid over the root's box: how many cross the faces of cells, and how many begin or end in cells. src/bvh/flux.rs says what
// that is for and is the twin; glsl/trace/flux.glsl fills it.
//
// A point (i, j, k) holds, up to there, the segments that cross the plane at i along x, j along y and k along z, and the ends in cells.
// By these sums from the scene's corner the segments across any face are four points.
//
// needs  fewer than 2^21 segments: then no sum here has more than 32 bits
#ifndef HEDGEROW_BVH_FLUX
#define HEDGEROW_BVH_FLUX
#include "bvh/layout.glsl"
#include "bvh/sah.glsl"

const uint FLUX_CELLS = 64;
const uint FLUX_POINTS = FLUX_CELLS + 1;
// Of a cell's edge: places on the grid are whole numbers of this part.
const uint FLUX_PARTS = 512;
const float FLUX_PLACES = 32768.0;
// Edges shorter than this have one cell, the scene's longest being 1 to 4.
const float FLUX_SHORTEST = 9.5367431640625e-7;   // 2^-20

layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer FluxGrid {
    vec3 lo;         // of the root's box, scaled
    float scale;     // of lengths, before all else
    vec3 factor;     // places for a scaled length, along each axis
    uint reserved;
    uvec4 point[];
};

uint flux_point(uvec3 at) {
    return (at.x * FLUX_POINTS + at.y) * FLUX_POINTS + at.z;
}

// The largest float whose product with b, rounded, is no more than a: the same on every device, whatever its division gives. For positive
// numbers whose ratio is neither huge nor tiny.
float flux_quotient(float a, float b) {
    // A division may be 2.5 units off, and the product half of one.
    uint bits = floatBitsToUint(a / b) + 8u;
    for (uint down = 0; down < 24; ++down) {
        precise float product = uintBitsToFloat(bits) * b;
        if (product <= a) break;
        bits--;
    }
    return uintBitsToFloat(bits);
}

uint flux_cell(uint place) {
    return min(place / FLUX_PARTS, FLUX_CELLS - 1u);
}

uvec3 flux_cells(uvec3 places) {
    return min(places / FLUX_PARTS, uvec3(FLUX_CELLS - 1u));
}

// Where a point in space lies on the grid; what is beside it lies on its wall.
uvec3 flux_place(FluxGrid grid, vec3 p) {
    precise vec3 place = (p * grid.scale - grid.lo) * grid.factor;
    return uvec3(clamp(place, vec3(0.0), vec3(FLUX_PLACES)));
}

// What a box takes of the points along an axis, two if it lies within a cell and four if not.
struct FluxTaps {
    uint count;
    uvec4 at;
    uvec4 face;      // both faces across the axis, each between two planes
    uvec4 along;     // from the one face to the other: sums up to the far one less those up to the near one
    vec4 width;      // the same by what lies between a point and the one before
};

FluxTaps flux_taps(uint lo, uint hi) {
    uint near = flux_cell(lo), far = flux_cell(hi);
    uint a = lo - FLUX_PARTS * near, b = hi - FLUX_PARTS * far;
    FluxTaps taps;
    if (near == far) {
        taps.count = 2;
        taps.at = uvec4(near, near + 1u, 0u, 0u);
        taps.face = uvec4(2u * FLUX_PARTS - a - b, a + b, 0u, 0u);
        taps.along = uvec4(a - b, b - a, 0u, 0u);
        taps.width = vec4(0.0, float(b - a), 0.0, 0.0);
    } else {
        taps.count = 4;
        taps.at = uvec4(near, near + 1u, far, far + 1u);
        taps.face = uvec4(FLUX_PARTS - a, a, FLUX_PARTS - b, b);
        taps.along = uvec4(a - FLUX_PARTS, 0u - a, FLUX_PARTS - b, b);
        taps.width = vec4(0.0, float(FLUX_PARTS - a), float(FLUX_PARTS), float(b));
    }
    return taps;
}

// How many segments meet a box: half of those that cross its faces and of the ends in it, linear within a cell. Differences are taken
// between whole numbers wherever they are large against what is left.
float flux_of(FluxGrid grid, Box b) {
    uvec3 lo = flux_place(grid, b.lo), hi = flux_place(grid, b.hi);
    FluxTaps x = flux_taps(lo.x, hi.x), y = flux_taps(lo.y, hi.y), z = flux_taps(lo.z, hi.z);
    precise float sum = 0.0;
    for (uint i = 0; i < x.count; ++i) {
        // Across the faces along x; of all else, up to here.
        precise float faces = 0.0;
        precise float others = 0.0;
        uvec4 before = uvec4(0);
        for (uint j = 0; j < y.count; ++j) {
            uvec4 row = uvec4(0);
            for (uint k = 0; k < z.count; ++k) {
                uint along = z.along[k];
                row += uvec4(along, along, z.face[k], along) * grid.point[flux_point(uvec3(x.at[i], y.at[j], z.at[k]))];
            }
            others = others + float(y.face[j]) * float(row.y);
            if (j > 0u) {
                uvec4 between = row - before;
                faces = faces + y.width[j] * float(between.x);
                others = others + y.width[j] * (float(between.z) + float(between.w));
            }
            before = row;
        }
        sum = sum + (float(x.face[i]) * faces + float(int(x.along[i])) * others);
    }
    // 2^9 parts along three axes, and half of it.
    return max(sum, 0.0) * 3.725290298461914e-9;
}
#endif
