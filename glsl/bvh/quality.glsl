// Quality of a Bvh2: SAH cost, depth, leaf statistics. src/bvh/quality.rs records the three steps and holds the twin.
//
//   parents  reads nodes                     writes parents[slot] (filled with NONE before)
//   measure  reads nodes, parents            writes partials[tile]
//   sum      reads header, partials          writes result; one workgroup
//
// A slot is part of the tree if climbing from it reaches the root; the climb is its depth. Sums are taken in a fixed order:
// the figures are the same on every run.
//
// needs  one barrier between each two; any subgroup size; 36 bytes of shared memory an invocation
#ifndef HEDGEROW_BVH_QUALITY
#define HEDGEROW_BVH_QUALITY
#include "gpu/pass.glsl"
#include "bvh/layout.glsl"

const uint NONE = 0xFFFFFFFFu;

struct Figures {
    float inner_area;     // Σ half area of inner nodes, over that of the root
    float leaf_area;      // Σ half area of leaves · triangles, over that of the root
    uint inner;
    uint leaves;
    uint refs;
    uint leaf_max;
    uint depth_sum[2];    // of the leaves; low word first
    uint depth_max;
};

BUFFER FiguresOf { Figures tile[]; };

layout(push_constant, scalar) uniform QualityArguments {
    Structure structure;
    Words parents;
    FiguresOf partials;
    FiguresOf result;
    uint rounds;   // slots of an invocation in a tile
    uint tiles;
};

Figures no_figures() {
    return Figures(0.0, 0.0, 0, 0, 0, 0, uint[2](0, 0), 0);
}

void add(inout Figures sum, Figures more) {
    sum.inner_area += more.inner_area;
    sum.leaf_area += more.leaf_area;
    sum.inner += more.inner;
    sum.leaves += more.leaves;
    sum.refs += more.refs;
    sum.leaf_max = max(sum.leaf_max, more.leaf_max);
    uint carry;
    sum.depth_sum[0] = uaddCarry(sum.depth_sum[0], more.depth_sum[0], carry);
    sum.depth_sum[1] += more.depth_sum[1] + carry;
    sum.depth_max = max(sum.depth_max, more.depth_max);
}

// Half the surface area of a box, relative to the scene's: each edge is divided first, so that nothing overflows.
float relative_area(vec3 lo, vec3 hi, float scale) {
    vec3 e = hi * scale - lo * scale;
    return e.x * e.y + e.y * e.z + e.z * e.x;
}

// Brings the longest edge of the scene near 1: src/bvh/sah.rs, area_scale.
float scale_of(Child root) {
    vec3 half_extent = 0.5 * root.hi - 0.5 * root.lo;
    float longest = max(half_extent.x, max(half_extent.y, half_extent.z));
    vec3 corner = max(abs(root.lo), abs(root.hi));
    float farthest = max(corner.x, max(corner.y, corner.z));
    ivec2 exponent = ivec2(floatBitsToUint(vec2(longest, farthest)) >> 23 & 0xFFu);
    return uintBitsToFloat(uint(min(clamp(127 + 127 - exponent.x, 1, 254), 3 * 127 - 1 - exponent.y)) << 23);
}

void count_leaf(inout Figures f, Child child, uint depth, float scale) {
    f.leaf_area += relative_area(child.lo, child.hi, scale) * float(child.count);
    f.leaves += 1;
    f.refs += child.count;
    f.leaf_max = max(f.leaf_max, child.count);
    f.depth_sum[0] += depth;
    f.depth_max = max(f.depth_max, depth);
}
#endif
