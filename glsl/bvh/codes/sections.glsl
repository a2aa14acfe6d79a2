// Robust bounds with sections for what is far and what is huge: src/bvh/codes/sections.rs explains them and is the twin.
//
//   find_sections   reads the primitives, state: bounds; the workgroup together   writes state: plan.sections
//   section_parts   of one primitive
#ifndef HEDGEROW_BVH_CODE_SECTIONS
#define HEDGEROW_BVH_CODE_SECTIONS
#include "bvh/build_state.glsl"

const uint SECTION_CORE = 0;
const uint SECTION_FAR = 1;
const uint SECTION_HUGE = 2;
// Primitives that are looked at.
const uint SECTION_SAMPLE = 256;
const uint SECTION_QUANTILE = 16;

// The sample lies in the sort's table: per primitive its centroid and its box, as `ordered` floats.
struct Sampled {
    uvec3 middle;
    uvec3 lo;
    uvec3 hi;
};
BUFFER Sample { Sampled primitive[]; };

const bool HAS_SECTIONS = CODE_PREFIX == PREFIX_SECTIONS;
shared uint sampled_count;
shared uint sampled_below[HAS_SECTIONS ? 18 : 1];   // of three rounds in turn: keys below three low candidates, three high ones
shared uint section_octaves[HAS_SECTIONS ? 9 : 1];  // of each axis: of the core's extent, from the core to the high and to the low bound
shared uint sampled_core[HAS_SECTIONS ? 6 : 1];     // low corner, high corner

bool is_inside(uvec3 lo, uvec3 hi, Box fences) {
    return all(greaterThanEqual(lo, ordered(fences.lo))) && all(lessThanEqual(hi, ordered(fences.hi)));
}

// `eighth` moved by `by` both ways, but not beyond the limits: of eighths, so that nothing overflows.
Box widened(Box eighth, vec3 by, Box limits) {
    precise vec3 lo = eighth.lo - by;
    precise vec3 hi = eighth.hi + by;
    return Box(mix(limits.lo, lo * 8.0, greaterThan(lo, limits.lo * 0.125)),
               mix(limits.hi, hi * 8.0, lessThan(hi, limits.hi * 0.125)));
}

Box fences_of(Box bounds, uvec3 low_quantile, uvec3 high_quantile) {
    precise vec3 low = from_ordered(low_quantile) * 0.125;
    precise vec3 high = from_ordered(high_quantile) * 0.125;
    precise vec3 widths = high - low;
    precise float least = 0.25 * max(max(widths.x, widths.y), max(widths.z, 0.0));
    precise vec3 by = 1.5 * max(widths, vec3(least));
    return widened(Box(low, high), by, bounds);
}

// What the sample found inside of the fences, and an eighth more to each side, for the sample misses the outermost.
Box core_of(Box fences) {
    uvec3 lo = uvec3(sampled_core[0], sampled_core[1], sampled_core[2]);
    uvec3 hi = uvec3(sampled_core[3], sampled_core[4], sampled_core[5]);
    Box sampled = fences;
    if (lo.x <= hi.x) sampled = Box(from_ordered(lo), from_ordered(hi));
    precise vec3 low_eighth = sampled.lo * 0.125;
    precise vec3 high_eighth = sampled.hi * 0.125;
    precise vec3 by = (high_eighth - low_eighth) * 0.125;
    return widened(Box(low_eighth, high_eighth), by, fences);
}

// A lane a distance, so that there is one copy of what computes it: drivers that go through every branch take long over three.
void write_sections(BuildState state, Box bounds, Box fences, Box core) {
    for (uint i = gl_LocalInvocationIndex; i < 9; i += gl_WorkGroupSize.x) {
        uint axis = i % 3, which = i / 3;
        vec3 from = which == 0 ? core.hi : which == 1 ? bounds.hi : bounds.lo;
        vec3 corner = which == 2 ? core.hi : core.lo;
        section_octaves[i] = octaves(from[axis], corner[axis]);
    }
    barrier();
    for (uint axis = gl_LocalInvocationIndex; axis < 3; axis += gl_WorkGroupSize.x) {
        uint reference = section_octaves[axis];
        uint farthest = max(section_octaves[3 + axis], section_octaves[6 + axis]);
        farthest = max(farthest - min(farthest, reference), 1);
        state.plan.sections.reference[axis] = reference;
        state.plan.sections.shift[axis] = 30 + uint(31 - findMSB(farthest));
    }
    if (gl_LocalInvocationIndex == 0) {
        bvec3 is_below = lessThan(ordered(bounds.lo), ordered(core.lo)), is_above = lessThan(ordered(core.hi), ordered(bounds.hi));
        uvec3 beyond = uvec3(is_below) | uvec3(is_above);
        state.plan.sections.fences = fences;
        state.plan.sections.core = core;
        state.plan.sections.head = 1;   // more is known with the recipe
        state.plan.sections.beyond = beyond.x | beyond.y << 1 | beyond.z << 2;
    }
}

void find_sections() {
    BuildState state = build_state();
    Sample table = Sample(part(parts.table));
    Geometry input_geometries = geometries();
    uint taken = min(primitive_count, SECTION_SAMPLE);
    if (gl_LocalInvocationIndex == 0) {
        sampled_count = 0;
        for (uint i = 0; i < 6; ++i) sampled_core[i] = i < 3 ? NONE : 0;
        for (uint i = 0; i < 18; ++i) sampled_below[i] = 0;
    }
    next_phase();
    for (uint i = gl_LocalInvocationIndex; i < taken; i += gl_WorkGroupSize.x) {
        // i · primitive_count / taken, which may have more than 32 bits on the way.
        uint primitive = i * (primitive_count / taken) + i * (primitive_count % taken) / taken;
        Box b;
        bool is_active = load_reference(input_geometries, primitive, b) == 0;
        table.primitive[i].middle = is_active ? ordered(centroid_of(b)) : uvec3(NONE);
        table.primitive[i].lo = ordered(b.lo);
        table.primitive[i].hi = ordered(b.hi);
        if (is_active) atomicAdd(sampled_count, 1);
    }
    next_phase();
    uint count = sampled_count;
    if (gl_LocalInvocationIndex == 0) state.plan.sections.head = 0;
    if (count == 0) return;

    // The keys of both ranks along each axis, bit by bit: the largest that no more keys than the rank are below.
    uint rank = count / SECTION_QUANTILE;
    uvec3 low = uvec3(0), high = uvec3(0);
    for (uint round = 0; round < 32; ++round) {
        uint at = round % 3 * 6, next = (round + 1) % 3 * 6;
        uvec3 try_low = low | 0x80000000u >> round, try_high = high | 0x80000000u >> round;
        uvec3 below_low = uvec3(0), below_high = uvec3(0);
        for (uint i = gl_LocalInvocationIndex; i < taken; i += gl_WorkGroupSize.x) {
            uvec3 key = table.primitive[i].middle;
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
    Box bounds = bounds_of_boxes(state);
    Box fences = fences_of(bounds, low, high);
    if (is_inside(ordered(bounds.lo), ordered(bounds.hi), fences)) return;
    uvec3 lo = uvec3(NONE), hi = uvec3(0);   // of the core
    for (uint i = gl_LocalInvocationIndex; i < taken; i += gl_WorkGroupSize.x) {
        Sampled sampled = table.primitive[i];
        if (sampled.middle.x != NONE && is_inside(sampled.lo, sampled.hi, fences)) {
            lo = min(lo, sampled.lo);
            hi = max(hi, sampled.hi);
        }
    }
    for (uint axis = 0; axis < 3; ++axis) {
        atomicMin(sampled_core[axis], lo[axis]);
        atomicMax(sampled_core[3 + axis], hi[axis]);
    }
    next_phase();
    write_sections(state, bounds, fences, core_of(fences));
}

// How many coordinate bits come before the one of what is far: the first of each axis.
uint head_of(Stretches s) {
    uint alone = s.bits[0].x + s.bits[0].y + s.bits[0].z;
    uint paired = s.bits[1].x + s.bits[1].y + s.bits[1].z;
    if (alone > 1) return 1;
    return alone + paired > 2 ? 2 : 3;
}

uint section_of(CodeSections s, Box b) {
    uvec3 lo = ordered(b.lo), hi = ordered(b.hi);
    if (is_inside(lo, hi, s.fences)) return SECTION_CORE;
    bool touches = all(lessThanEqual(lo, ordered(s.core.hi))) && all(greaterThanEqual(hi, ordered(s.core.lo)));
    return touches ? SECTION_HUGE : SECTION_FAR;
}

// The coordinate of what is not of the core, from that within the core: the lower and the upper quarter are for what is beyond.
uvec2 beyond_core(CodeSections s, uint axis, float at, uvec2 within) {
    if ((s.beyond >> axis & 1) == 0) return within;
    float lo = s.core.lo[axis], hi = s.core.hi[axis];
    uint place = ordered(vec3(at)).x;
    bool is_below = place < ordered(s.core.lo)[axis];
    bool is_above = place > ordered(s.core.hi)[axis];
    if (!is_below && !is_above) return add(uvec2(0, 0x40000000u), shift_right(within, 1));
    uint distance = octaves(at, is_below ? hi : lo);
    uvec2 tail = shift_left(uvec2(distance - min(distance, s.reference[axis]), 0), s.shift[axis]);
    return is_below ? subtract(uvec2(0xFFFFFFFFu, 0x3FFFFFFFu), tail) : add(uvec2(0, 0xC0000000u), tail);
}

CodeParts section_parts(CodeKind kind, CodePlan plan, Box b) {
    CodeParts parts = plain_parts(kind, plan, b);
    parts.section = SECTION_CORE;
    // Most scenes have one section, and most primitives are of the core. Loops of at most one round, for a driver on a CPU leaves a
    // loop that no lane is in, and goes through every branch.
    for (uint round = plan.sections.head == 0 ? 1 : 0; round < 1; ++round) parts.section = section_of(plan.sections, b);
    for (uint round = parts.section == SECTION_CORE ? 1 : 0; round < 1; ++round) {
        vec3 at = centroid_of(b);
        for (uint axis = 0; axis < 3; ++axis) {
            parts.coordinates[axis] = beyond_core(plan.sections, axis, at[axis], parts.coordinates[axis]);
        }
        parts.size = 0xFFFFu;
    }
    return parts;
}

// The bits of the section put into a code.
uvec2 with_section(CodeKind kind, CodePlan plan, CodeParts parts, uvec2 code) {
    for (uint round = plan.sections.head == 0 ? 1 : 0; round < 1; ++round) {
        uint behind = kind.bits - plan.sections.head;
        uvec2 head = shift_right(code, behind);
        uvec2 rest = shift_right(bits_of(code, 64 - behind, behind), 2);
        uvec2 huge = uvec2(parts.section == SECTION_HUGE ? 1 : 0, 0);
        uvec2 beyond = uvec2(parts.section == SECTION_CORE ? 0 : 1, 0);
        code = shift_left(huge, kind.bits - 1) | shift_left(head, behind - 1) | shift_left(beyond, behind - 2) | rest;
    }
    return code;
}
#endif
