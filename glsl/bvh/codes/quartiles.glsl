// Quartiles of a sample of centroids, and fences around them: src/bvh/codes/sections.rs explains them and is the twin.
//
//   begin_sample     one invocation                                  writes shared memory
//   take_sample      of one number of the sample                     writes the sample, shared memory
//   find_quartiles   the workgroup together; of a sample that there is   reads the sample, writes shared memory
//   fences_beyond    right behind it, the workgroup together             reads the sample, writes shared memory
//
// needs  HAS_SECTIONS of the includer, without which there are none; a barrier for buffers and shared memory between each two, but for
//        the last; any subgroup size
#ifndef HEDGEROW_BVH_CODE_QUARTILES
#define HEDGEROW_BVH_CODE_QUARTILES
#include "bvh/geometry.glsl"

// Primitives that are looked at.
const uint SECTION_SAMPLE = 256;
const uint SECTION_QUARTILE = 4;
// Distances between the quartiles from there to the fences.
const float TO_FENCES = 2.0;
// Parts of the way there, and how many without a centroid are a gap.
const uint STEPS = 32;
const uint GAP = 16;
const float SMALLEST_NORMAL = 1.1754943508222875e-38;
const float LARGEST_FLOAT = 3.4028234663852886e38;
const Box EVERYWHERE = Box(vec3(-LARGEST_FLOAT), vec3(LARGEST_FLOAT));
// The place of one that is left out, behind all others.
const uint NOWHERE = 0xFFFFFFFFu;

// The centroids, as `ordered` floats.
BUFFER Sample { uvec3 middle[]; };

shared uint sampled_count;
shared uint sampled_end;   // behind the last one in the sample that is not left out
shared uint sampled_below[HAS_SECTIONS ? 18 : 1];   // of three rounds in turn: keys below three low candidates, three high ones

void begin_sample() {
    sampled_count = 0;
    sampled_end = 0;
    for (uint i = 0; i < 18; ++i) sampled_below[i] = 0;
}

// The i-th of so many taken of all: i · count / taken, which may have more than 32 bits on the way.
uint sampled_at(uint i, uint taken, uint count) {
    return i * (count / taken) + i * (count % taken) / taken;
}

void take_sample(Sample table, uint i, bool is_active, Box b) {
    table.middle[i] = is_active ? ordered(centroid_of(b)) : uvec3(NOWHERE);
    if (is_active) {
        atomicAdd(sampled_count, 1);
        atomicMax(sampled_end, i + 1);
    }
}

Box find_quartiles(Sample table, uint taken) {
    // The keys of both ranks along each axis, bit by bit: the largest that no more keys than the rank are below.
    uint count = sampled_count, rank = count / SECTION_QUARTILE;
    uvec3 low = uvec3(0), high = uvec3(0);
    for (uint round = 0; round < 32; ++round) {
        uint at = round % 3 * 6, next = (round + 1) % 3 * 6;
        uvec3 try_low = low | 0x80000000u >> round, try_high = high | 0x80000000u >> round;
        uvec3 below_low = uvec3(0), below_high = uvec3(0);
        for (uint i = gl_LocalInvocationIndex; i < taken; i += gl_WorkGroupSize.x) {
            uvec3 key = table.middle[i];
            below_low += uvec3(lessThan(key, try_low));
            below_high += uvec3(lessThan(key, try_high));
        }
        below_low = subgroupAdd(below_low);
        below_high = subgroupAdd(below_high);
        if (subgroupElect()) {
            for (uint axis = 0; axis < 3; ++axis) {
                atomicAdd(sampled_below[at + axis], below_low[axis]);
                atomicAdd(sampled_below[at + 3 + axis], below_high[axis]);
            }
        }
        // What was read in the round before the last is free.
        if (gl_LocalInvocationIndex == 0) {
            for (uint i = 0; i < 6; ++i) sampled_below[next + i] = 0;
        }
        barrier();
        for (uint axis = 0; axis < 3; ++axis) {
            if (sampled_below[at + axis] <= rank) low[axis] = try_low[axis];
            if (sampled_below[at + 3 + axis] <= count - 1 - rank) high[axis] = try_high[axis];
        }
    }
    return Box(from_ordered(low), from_ordered(high));
}

bool is_inside(uvec3 lo, uvec3 hi, Box fences) {
    return all(greaterThanEqual(lo, ordered(fences.lo))) && all(lessThanEqual(hi, ordered(fences.hi)));
}

// Of each axis the bit of the step that so far beyond a quartile lies in; none beyond the last.
uvec3 step_at(vec3 distance, vec3 size) {
    uvec3 at = uvec3(0);
    for (uint more = STEPS / 2; more != 0; more >>= 1) {
        precise vec3 begin = vec3(at + more) * size;
        at += more * uvec3(lessThanEqual(begin, distance));
    }
    precise vec3 end = float(STEPS) * size;
    uvec3 is_on_the_way = uvec3(greaterThanEqual(distance, vec3(0))) & uvec3(lessThan(distance, end));
    return is_on_the_way << at;
}

// How many steps beyond a quartile the fence stands.
uint steps_to_fence(uint taken, float size) {
    uint gaps = ~taken;
    for (uint i = 1; i < GAP; ++i) gaps &= gaps >> 1;
    uint gap = min(uint(findLSB(gaps)), STEPS);
    bool has_more = gap + GAP < STEPS && taken >> (gap + GAP) != 0;
    return size >= SMALLEST_NORMAL && has_more ? gap + GAP / 2 : STEPS;
}

// So far beyond the quartiles, or in a gap before that, as far as floats go: by eighths, so that nothing overflows.
Box fences_beyond(Sample table, uint taken, Box quartiles) {
    precise vec3 low = quartiles.lo * 0.125;
    precise vec3 high = quartiles.hi * 0.125;
    precise vec3 widths = high - low;
    precise float least = 0.25 * max(max(widths.x, widths.y), max(widths.z, 0.0));
    precise vec3 size = max(widths, vec3(least)) * (TO_FENCES / float(STEPS));
    uvec3 before = uvec3(0), behind = uvec3(0);
    for (uint i = gl_LocalInvocationIndex; i < taken; i += gl_WorkGroupSize.x) {
        uvec3 key = table.middle[i];
        if (key.x == NOWHERE) continue;
        precise vec3 at = from_ordered(key) * 0.125;
        precise vec3 to_low = low - at;
        precise vec3 from_high = at - high;
        before |= step_at(to_low, size);
        behind |= step_at(from_high, size);
    }
    before = subgroupOr(before);
    behind = subgroupOr(behind);
    // The counters that the last round of the quartiles has cleared.
    const uint cleared = 32 % 3 * 6;
    if (subgroupElect()) {
        for (uint axis = 0; axis < 3; ++axis) {
            atomicOr(sampled_below[cleared + axis], before[axis]);
            atomicOr(sampled_below[cleared + 3 + axis], behind[axis]);
        }
    }
    barrier();
    precise vec3 lo, hi;
    for (uint axis = 0; axis < 3; ++axis) {
        lo[axis] = low[axis] - float(steps_to_fence(sampled_below[cleared + axis], size[axis])) * size[axis];
        hi[axis] = high[axis] + float(steps_to_fence(sampled_below[cleared + 3 + axis], size[axis])) * size[axis];
    }
    return Box(mix(EVERYWHERE.lo, lo * 8.0, greaterThan(lo, EVERYWHERE.lo * 0.125)),
               mix(EVERYWHERE.hi, hi * 8.0, lessThan(hi, EVERYWHERE.hi * 0.125)));
}
#endif
