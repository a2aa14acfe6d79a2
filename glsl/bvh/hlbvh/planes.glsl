// The planes that split a range of clusters, for bvh/hlbvh/split.glsl.
//
// Of few clusters every centroid is a plane that is tried; of more, the planes between BINS slabs of the box around the centroids. A
// plane costs, on either side, the area of the box around the clusters times the primitives in them.
#ifndef HEDGEROW_BVH_HLBVH_PLANES
#define HEDGEROW_BVH_HLBVH_PLANES
#include "bvh/hlbvh.glsl"

// As src/bvh/twin/hlbvh.rs has them.
const uint BINS = 16;
const uint SWEPT = 16;
const float LEAST_EXTENT = 7.888609052210118e-31;   // 2^-100
// Planes of all three axes have numbers: of a sweep, those of the clusters; of bins, of the one before.
const uint NO_PLANE = 0xFFFFFFFFu;
const uint INFINITE = 0x7F800000u;

// One side of a plane.
struct Side {
    vec3 lo;
    vec3 hi;
    uint primitives;
    uint clusters;
};

// A plane with what is on either side.
struct Plane {
    uint cost;       // the bits of a float that is not negative
    uint number;
    uint axis;
    float at;        // of a sweep: the greatest centroid on the left
    uint bin;        // of bins: the last on the left
    Side left;
    Side right;
};

// Of a sweep.
shared vec3 swept_lo[SWEPT];
shared vec3 swept_hi[SWEPT];
shared uint swept_primitives[SWEPT];
// Of bins: `ordered` floats.
shared uint bin_lo[3u * BINS * 3u];
shared uint bin_hi[3u * BINS * 3u];
shared uint bin_primitives[3u * BINS];
shared uint bin_clusters[3u * BINS];
shared uint centroids_lo[3];
shared uint centroids_hi[3];

Side empty_side() {
    return Side(vec3(uintBitsToFloat(0x7F800000u)), vec3(uintBitsToFloat(0xFF800000u)), 0u, 0u);
}

Side with_box(Side s, vec3 lo, vec3 hi, uint primitives, uint clusters) {
    return Side(min(s.lo, lo), max(s.hi, hi), s.primitives + primitives, s.clusters + clusters);
}

// Cost of a plane; NO_PLANE's where a side is empty.
uint plane_cost(Side left, Side right, float area_scale) {
    if (left.clusters == 0u || right.clusters == 0u) return INFINITE;
    precise float cost = scaled_half_area(Box(left.lo, left.hi), area_scale) * float(left.primitives)
                       + scaled_half_area(Box(right.lo, right.hi), area_scale) * float(right.primitives);
    return floatBitsToUint(cost);
}

// ---- few clusters: all planes ----

Plane sweep(Words order, Clusters clusters, Task t, float area_scale) {
    uint count = t.end - t.begin;
    for (uint i = gl_LocalInvocationIndex; i < count; i += gl_WorkGroupSize.x) {
        uint c = order.word[t.begin + i];
        swept_lo[i] = clusters.cluster[c].lo;
        swept_hi[i] = clusters.cluster[c].hi;
        swept_primitives[i] = clusters.cluster[c].count;
    }
    barrier();
    Plane best;
    best.cost = INFINITE;
    best.number = NO_PLANE;
    for (uint number = gl_LocalInvocationIndex; number < 3u * count; number += gl_WorkGroupSize.x) {
        uint axis = number / count, own = number % count;
        float at = centroid_of(Box(swept_lo[own], swept_hi[own]))[axis];
        Side left = empty_side(), right = empty_side();
        for (uint i = 0; i < count; ++i) {
            vec3 lo = swept_lo[i], hi = swept_hi[i];
            bool is_left = centroid_of(Box(lo, hi))[axis] <= at;
            if (is_left) left = with_box(left, lo, hi, swept_primitives[i], 1u);
            else right = with_box(right, lo, hi, swept_primitives[i], 1u);
        }
        uint cost = plane_cost(left, right, area_scale);
        if (cost < best.cost) best = Plane(cost, number, axis, at, 0u, left, right);
    }
    return best;
}

// ---- many clusters: bins ----

struct Slabs {
    vec3 lo;        // of the centroids, scaled
    vec3 factor;    // one over their extent; 0 of a flat one
};

Slabs slabs_of(float area_scale) {
    precise vec3 lo = from_ordered(uvec3(centroids_lo[0], centroids_lo[1], centroids_lo[2])) * area_scale;
    precise vec3 hi = from_ordered(uvec3(centroids_hi[0], centroids_hi[1], centroids_hi[2])) * area_scale;
    precise vec3 extent = hi - lo;
    vec3 factor;
    for (uint axis = 0; axis < 3u; ++axis) factor[axis] = extent[axis] < LEAST_EXTENT ? 0.0 : reciprocal_or_zero(extent[axis]);
    return Slabs(lo, factor);
}

uvec3 bins_of(Slabs slabs, vec3 point, float area_scale) {
    precise vec3 at = (point * area_scale - slabs.lo) * slabs.factor * float(BINS);
    return min(uvec3(at), uvec3(BINS - 1u));
}

void find_centroids(Words order, Clusters clusters, Task t) {
    for (uint axis = gl_LocalInvocationIndex; axis < 3u; axis += gl_WorkGroupSize.x) {
        centroids_lo[axis] = NONE;
        centroids_hi[axis] = 0u;
    }
    barrier();
    uvec3 lo = uvec3(NONE), hi = uvec3(0);
    for (uint i = t.begin + gl_LocalInvocationIndex; i < t.end; i += gl_WorkGroupSize.x) {
        uint c = order.word[i];
        uvec3 point = ordered(centroid_of(Box(clusters.cluster[c].lo, clusters.cluster[c].hi)));
        lo = min(lo, point);
        hi = max(hi, point);
    }
    lo = subgroupMin(lo);
    hi = subgroupMax(hi);
    if (subgroupElect()) {
        for (uint axis = 0; axis < 3u; ++axis) {
            atomicMin(centroids_lo[axis], lo[axis]);
            atomicMax(centroids_hi[axis], hi[axis]);
        }
    }
    barrier();
}

// On a CPU each lane has bins of its own and all look at the same cluster: that takes no atomics.
void fill_own_bins(Words order, Clusters clusters, Task t, Slabs slabs, float area_scale) {
    for (uint own = gl_LocalInvocationIndex; own < 3u * BINS; own += gl_WorkGroupSize.x) {
        uint axis = own / BINS, bin = own % BINS;
        Side s = empty_side();
        for (uint i = t.begin; i < t.end; ++i) {
            uint c = listed(order, i);
            vec3 lo = clusters.cluster[c].lo, hi = clusters.cluster[c].hi;
            bool is_in = bins_of(slabs, centroid_of(Box(lo, hi)), area_scale)[axis] == bin;
            if (is_in) s = with_box(s, lo, hi, clusters.cluster[c].count, 1u);
        }
        bin_primitives[own] = s.primitives;
        bin_clusters[own] = s.clusters;
        uvec3 lo = ordered(s.lo), hi = ordered(s.hi);
        for (uint side = 0; side < 3u; ++side) {
            bin_lo[3u * own + side] = lo[side];
            bin_hi[3u * own + side] = hi[side];
        }
    }
    barrier();
}

void fill_bins(Words order, Clusters clusters, Task t, Slabs slabs, float area_scale) {
    for (uint i = gl_LocalInvocationIndex; i < 3u * BINS; i += gl_WorkGroupSize.x) {
        bin_primitives[i] = 0u;
        bin_clusters[i] = 0u;
        for (uint side = 0; side < 3u; ++side) {
            bin_lo[3u * i + side] = NONE;
            bin_hi[3u * i + side] = 0u;
        }
    }
    barrier();
    for (uint i = t.begin + gl_LocalInvocationIndex; i < t.end; i += gl_WorkGroupSize.x) {
        uint c = order.word[i];
        Box b = Box(clusters.cluster[c].lo, clusters.cluster[c].hi);
        uint primitives = clusters.cluster[c].count;
        uvec3 bins = bins_of(slabs, centroid_of(b), area_scale);
        uvec3 lo = ordered(b.lo), hi = ordered(b.hi);
        // Integers: the order in which the atomics arrive changes nothing.
        for (uint axis = 0; axis < 3u; ++axis) {
            uint bin = axis * BINS + bins[axis];
            atomicAdd(bin_primitives[bin], primitives);
            atomicAdd(bin_clusters[bin], 1u);
            for (uint side = 0; side < 3u; ++side) {
                atomicMin(bin_lo[3u * bin + side], lo[side]);
                atomicMax(bin_hi[3u * bin + side], hi[side]);
            }
        }
    }
    barrier();
}

Side with_bin(Side s, uint bin) {
    if (bin_clusters[bin] == 0u) return s;
    vec3 lo = from_ordered(uvec3(bin_lo[3u * bin], bin_lo[3u * bin + 1u], bin_lo[3u * bin + 2u]));
    vec3 hi = from_ordered(uvec3(bin_hi[3u * bin], bin_hi[3u * bin + 1u], bin_hi[3u * bin + 2u]));
    return with_box(s, lo, hi, bin_primitives[bin], bin_clusters[bin]);
}

Plane best_of_bins(float area_scale) {
    Plane best;
    best.cost = INFINITE;
    best.number = NO_PLANE;
    // On a CPU all lanes look at the same bin: one load instead of one a lane.
    uint turns = PRIVATE_COUNTERS ? 3u : 1u, lanes = PRIVATE_COUNTERS ? BINS : 3u * BINS;
    for (uint turn = 0; turn < turns; ++turn) {
        for (uint lane = gl_LocalInvocationIndex; lane < lanes; lane += gl_WorkGroupSize.x) {
            uint axis = PRIVATE_COUNTERS ? turn : lane / BINS, plane = lane % BINS;
            Side left = empty_side(), right = empty_side();
            for (uint bin = 0; bin < BINS; ++bin) {
                if (bin <= plane) left = with_bin(left, axis * BINS + bin);
                else right = with_bin(right, axis * BINS + bin);
            }
            uint cost = plane_cost(left, right, area_scale);
            if (cost < best.cost) best = Plane(cost, axis * BINS + plane, axis, 0.0, plane, left, right);
        }
    }
    return best;
}
#endif
