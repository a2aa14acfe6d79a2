// References instead of triangles: large ones become several, with tighter boxes (Karras and Aila 2013, section 5). Each phase is
// a function over a task (a workgroup's worth of items). src/bvh/split.rs records them and has the formulas; the twin is
// src/bvh/twin/split.rs.
//
//   reset       writes state: empty bounds, histogram (zero)
//   bounds      reads the triangles                  writes state: bounds
//   grid        reads state: bounds                  writes state: grid; one invocation
//   weigh       reads the triangles, state: grid     writes counts (each triangle's weight), state: histogram
//   factor      reads state: histogram               writes state: factor; one workgroup
//   count       reads counts, state: factor          writes counts (each triangle's splits)
//   (scan       of counts: gpu/scan.glsl             writes counts (the splits of all triangles before), total)
//   references  reads the triangles, counts, total   writes references
//
// needs one barrier between each two, and before the first; subgroups of any size; workgroups of whole subgroups
#ifndef HEDGEROW_BVH_SPLIT
#define HEDGEROW_BVH_SPLIT
#include "bvh/primitives.glsl"
#include "bvh/split/planes.glsl"

// Items of an invocation in a task: all kernels of a build have the word of bvh/build_state.glsl.
layout(constant_id = 1) const uint ITEMS_WORD = 1;
const uint ITEMS = ITEMS_WORD & 0xFFFFu;

layout(push_constant, scalar) uniform SplitArguments {
    uvec2 vertices;
    uvec2 indices;
    uvec2 transform;
    uvec2 state_address;
    uvec2 references_address;
    uvec2 counts_address;       // of each triangle: its weight, then its splits, then those of all before
    uvec2 total_address;
    uint vertex_stride;
    uint vertex_count;
    uint formats;
    uint primitive_count;
    uint reference_count;       // at most
    uint most_splits;           // of a triangle
};

// Of a triangle that is not split.
const uint NO_WEIGHT = 0xFFFFFFFFu;
const uint MOST_FACTOR = 1056;
// Fewer splits than that has any triangle.
const uint SPLITS_BITS = 10;

Geometry triangles_given() {
    return Geometry(vertices, indices, transform, vertex_stride, vertex_count, formats, 0);
}

SplitState state_of_split() {
    return SplitState(state_address);
}

uint first_item(uint task) {
    return task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
}

void reset_split() {
    SplitState state = state_of_split();
    for (uint i = gl_LocalInvocationIndex; i < SPLIT_WEIGHTS; i += gl_WorkGroupSize.x) state.histogram[i] = 0;
    if (gl_LocalInvocationIndex != 0) return;
    for (uint axis = 0; axis < 3; ++axis) {
        state.lo[axis] = 0xFFFFFFFFu;
        state.hi[axis] = 0;
    }
    state.primitive_count = primitive_count;
}

// Of a workgroup of several subgroups: the least corner, and the greatest.
shared uint group_bounds[6];

void find_split_bounds(uint task) {
    SplitState state = state_of_split();
    Geometry given = triangles_given();
    uvec3 lo = uvec3(0xFFFFFFFFu), hi = uvec3(0);
    for (uint k = 0; k < ITEMS; ++k) {
        uint primitive = first_item(task) + k * gl_WorkGroupSize.x;
        if (primitive < primitive_count) {
            Box b;
            if (load_box(given, primitive, b) == 0) {
                lo = min(lo, ordered(b.lo));
                hi = max(hi, ordered(b.hi));
            }
        }
    }
    lo = subgroupMin(lo);
    hi = subgroupMax(hi);
    if (gl_NumSubgroups == 1u) {
        if (subgroupElect()) {
            for (uint axis = 0; axis < 3; ++axis) {
                atomicMin(state.lo[axis], lo[axis]);
                atomicMax(state.hi[axis], hi[axis]);
            }
        }
        return;
    }
    // Six atomics a workgroup: all of the device's meet at the same line of memory.
    for (uint i = gl_LocalInvocationIndex; i < 6; i += gl_WorkGroupSize.x) group_bounds[i] = i < 3 ? 0xFFFFFFFFu : 0;
    barrier();
    if (subgroupElect()) {
        for (uint axis = 0; axis < 3; ++axis) {
            atomicMin(group_bounds[axis], lo[axis]);
            atomicMax(group_bounds[3 + axis], hi[axis]);
        }
    }
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < 6; i += gl_WorkGroupSize.x) {
        if (i < 3) atomicMin(state.lo[i], group_bounds[i]);
        else atomicMax(state.hi[i - 3], group_bounds[i]);
    }
}

void make_grid() {
    if (gl_LocalInvocationIndex != 0) return;
    SplitState state = state_of_split();
    uvec3 lo = uvec3(state.lo[0], state.lo[1], state.lo[2]), hi = uvec3(state.hi[0], state.hi[1], state.hi[2]);
    SplitGrid none = SplitGrid(vec3(0), vec3(0), vec3(0), uvec3(0), 0.0);
    if (lo.x <= hi.x) state.grid = grid_over(Box(from_ordered(lo), from_ordered(hi)));
    else state.grid = none;
}

// The weight of a triangle, as a number that counts eighths of octaves.
uint weight_of(SplitGrid grid, Corners c) {
    const float SMALLEST = power_of_two(-40);
    Box b = box_around(c);
    SplitPlane plane;
    if (!find_plane(grid, b, plane)) return NO_WEIGHT;
    precise vec3 e = (b.hi - b.lo) * grid.scale;
    precise vec3 p = (c.v1 - c.v0) * grid.scale;
    precise vec3 q = (c.v2 - c.v0) * grid.scale;
    e = mix(e, vec3(0), lessThan(e, vec3(SMALLEST)));
    p = mix(p, vec3(0), lessThan(abs(p), vec3(SMALLEST)));
    q = mix(q, vec3(0), lessThan(abs(q), vec3(SMALLEST)));
    precise vec3 normal = p.yzx * q.zxy - p.zxy * q.yzx;
    precise float of_box = e.x * e.y + e.y * e.z + e.z * e.x;
    precise float ideal = 0.5 * (abs(normal.x) + abs(normal.y) + abs(normal.z));
    precise float saved = of_box - ideal;
    if (saved <= 0.0) return NO_WEIGHT;
    // The exponent of the area, 96 being its least, less the plane's level; and three bits of the mantissa.
    int weight = int(floatBitsToUint(saved) >> 20) - int(8 * (127 - 96 + plane.level));
    return weight < 0 ? NO_WEIGHT : min(uint(weight), SPLIT_WEIGHTS - 1);
}

// The splits of a triangle: the cube root of weight times factor, rounded down, or as many as it may have.
uint splits_of(uint weight, uint factor) {
    if (weight == NO_WEIGHT) return 0;
    // Sixteenths of mantissas, and exponents.
    uint product = (8 + (weight & 7)) * (8 + (factor & 7));
    int shift = int(weight >> 3) + int(factor >> 3) - 100 - 6;
    const uint MOST = (1u << 3 * SPLITS_BITS) - 1;
    uint cube = shift < -31 ? 0 : shift < 0 ? product >> -shift : shift > 22 ? MOST : min(product << shift, MOST);
    uint root = 0;
    for (uint bit = SPLITS_BITS; bit-- > 0;) {
        uint larger = root | 1 << bit;
        if (larger * larger * larger <= cube) root = larger;
    }
    return min(root, most_splits);
}

void weigh_triangles(uint task) {
    SplitState state = state_of_split();
    Geometry given = triangles_given();
    Words counts = Words(counts_address);
    SplitGrid grid = state.grid;
    for (uint k = 0; k < ITEMS; ++k) {
        uint primitive = first_item(task) + k * gl_WorkGroupSize.x;
        if (primitive < primitive_count) {
            Corners c;
            bool is_active = load_corners(given, primitive, c) == 0;
            uint weight = is_active && grid.scale > 0.0 ? weight_of(grid, c) : NO_WEIGHT;
            counts.word[primitive] = weight;
            if (weight != NO_WEIGHT) atomicAdd(state.histogram[weight], 1);
        }
    }
}

shared uint sums[gl_WorkGroupSize.x];

// Whether all splits with this factor are within the budget.
bool is_affordable(SplitState state, uint factor, uint budget) {
    uint sum = 0;
    for (uint weight = gl_LocalInvocationIndex; weight < SPLIT_WEIGHTS; weight += gl_WorkGroupSize.x) {
        uint count = state.histogram[weight], splits = splits_of(weight, factor);
        // What is too much stays at one more than the budget.
        uint product = splits != 0 && count > budget / splits ? budget + 1 : count * splits;
        sum = min(sum + product, budget + 1);
    }
    sums[gl_LocalInvocationIndex] = sum;
    barrier();
    uint total = 0;
    for (uint i = 0; i < gl_WorkGroupSize.x; ++i) total = min(total + sums[i], budget + 1);
    barrier();
    return total <= budget;
}

// The greatest factor that is affordable; 0 is.
void find_factor() {
    SplitState state = state_of_split();
    uint budget = reference_count - primitive_count;
    uint factor = 0, end = MOST_FACTOR;
    for (uint halving = 0; halving < 11 && factor + 1 < end; ++halving) {
        uint middle = (factor + end) / 2;
        if (is_affordable(state, middle, budget)) factor = middle;
        else end = middle;
    }
    if (gl_LocalInvocationIndex == 0) state.factor = factor;
}

void count_splits(uint task) {
    Words counts = Words(counts_address);
    uint factor = state_of_split().factor;
    for (uint k = 0; k < ITEMS; ++k) {
        uint primitive = first_item(task) + k * gl_WorkGroupSize.x;
        if (primitive < primitive_count) counts.word[primitive] = splits_of(counts.word[primitive], factor);
    }
}

// The triangle that has the split of this number: the last with no more before it.
uint triangle_of_split(Words before, uint number) {
    uint at = 0, end = primitive_count;
    for (uint halving = 0; halving < 32 && at + 1 < end; ++halving) {
        uint middle = at + (end - at) / 2;
        if (before.word[middle] <= number) at = middle;
        else end = middle;
    }
    return at;
}

// Each triangle's first part lies at its own place, the others behind those of all triangles, in their order.
void write_references(uint task) {
    SplitState state = state_of_split();
    References references = References(references_address);
    Geometry given = triangles_given();
    Words before = Words(counts_address);
    uint total = Words(total_address).word[0];
    SplitGrid grid = state.grid;
    for (uint k = 0; k < ITEMS; ++k) {
        uint i = first_item(task) + k * gl_WorkGroupSize.x;
        if (i < reference_count) {
            Reference reference = Reference(vec3(0), NO_PRIMITIVE, vec3(0), INACTIVE);
            if (i < primitive_count || i - primitive_count < total) {
                uint primitive = i < primitive_count ? i : triangle_of_split(before, i - primitive_count);
                uint number = i < primitive_count ? 0 : i - primitive_count - before.word[primitive] + 1;
                uint splits = (primitive + 1 < primitive_count ? before.word[primitive + 1] : total) - before.word[primitive];
                Corners c;
                uint why_not = load_corners(given, primitive, c);
                Box b;
                bool is_there = find_part(grid, c, splits, number, b);
                if (is_there) reference = Reference(b.lo, primitive, b.hi, why_not);
            }
            references.reference[i] = reference;
        }
    }
}
#endif
