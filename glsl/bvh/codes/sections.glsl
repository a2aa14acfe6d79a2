// Robust bounds with sections for what is far and what is huge: src/bvh/codes/sections.rs explains them and is the twin.
//
//   find_fences     reads the primitives; the workgroup together                  writes state: plan.sections.fences, plan.typical
//   find_sections   reads state: fences, bounds, core; the workgroup together     writes state: plan.sections
//   section_parts   of one primitive
#ifndef HEDGEROW_BVH_CODE_SECTIONS
#define HEDGEROW_BVH_CODE_SECTIONS
#include "bvh/build_state.glsl"
#include "bvh/codes/quartiles.glsl"

const uint SECTION_CORE = 0;
const uint SECTION_FAR = 1;
const uint SECTION_HUGE = 2;
shared uint section_octaves[HAS_SECTIONS ? 9 : 1];  // of each axis: of the core's extent, from the core to the high and to the low bound

// Half of the extents that primitives would have whose centroids lie evenly between bounds, and have these quartiles, as integers like
// those of extents_of.
ivec3 typical_extents(Box quartiles) {
    precise vec3 low = quartiles.lo * 0.125;
    precise vec3 high = quartiles.hi * 0.125;
    precise vec3 eighths = high - low;
    return mix(ivec3(-0x40000000), floatBitsToInt(eighths) + (3 << 23), greaterThan(eighths, vec3(0)));
}

// The box of what is inside the fences; where nothing is, as far as the bounds reach.
Box core_of(BuildState state, Box bounds, Box fences) {
    uvec3 lo = uvec3(state.core_lo[0], state.core_lo[1], state.core_lo[2]);
    uvec3 hi = uvec3(state.core_hi[0], state.core_hi[1], state.core_hi[2]);
    if (lo.x > hi.x) {
        lo = max(ordered(fences.lo), ordered(bounds.lo));
        hi = min(ordered(fences.hi), ordered(bounds.hi));
    }
    return Box(from_ordered(lo), from_ordered(hi));
}

// A lane a distance, so that there is one copy of what computes it: drivers that go through every branch take long over three.
void write_sections(BuildState state, Box bounds, Box core) {
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
        state.plan.sections.core = core;
        state.plan.sections.head = 1;   // more is known with the recipe
        state.plan.sections.beyond = beyond.x | beyond.y << 1 | beyond.z << 2;
    }
}

void find_fences() {
    BuildState state = build_state();
    Sample table = Sample(part(parts.table));
    Geometry input_geometries = geometries();
    // Twice where those at the end are left out: re-braiding has as many entries as there may be, and uses the first.
    uint count = primitive_count, taken = 0;
    for (uint round = 0; round < 2; ++round) {
        taken = min(count, SECTION_SAMPLE);
        barrier();   // the counters of the first round have been read
        if (gl_LocalInvocationIndex == 0) begin_sample();
        next_phase();
        for (uint i = gl_LocalInvocationIndex; i < taken; i += gl_WorkGroupSize.x) {
            Box b;
            bool is_active = load_reference(input_geometries, sampled_at(i, taken, count), b) == 0;
            take_sample(table, i, is_active, b);
        }
        next_phase();
        uint end = taken == 0 ? 0 : sampled_at(sampled_end, taken, count);
        if (end == count) break;
        count = end;
    }
    // Without a sample nothing is far, and codes have the bits that they are given.
    Box fences = EVERYWHERE;
    ivec3 typical = ivec3(0x7F800000);
    if (sampled_count != 0) {
        Box quartiles = find_quartiles(table, taken);
        fences = fences_beyond(table, taken, quartiles);
        typical = typical_extents(quartiles);
    }
    if (gl_LocalInvocationIndex == 0) {
        state.plan.sections.fences = fences;
        state.plan.typical = typical;
    }
}

void find_sections() {
    BuildState state = build_state();
    if (gl_LocalInvocationIndex == 0) {
        state.plan.sections.head = 0;
        state.plan.bits = given_code_bits();
        state.passes_left_out = passes - min((given_code_bits() + DIGIT_BITS - 1) / DIGIT_BITS, passes);
    }
    Box bounds = bounds_of_boxes(state), fences = state.plan.sections.fences;
    if (is_inside(ordered(bounds.lo), ordered(bounds.hi), fences)) return;
    write_sections(state, bounds, core_of(state, bounds, fences));
}

// In place of how many coordinate bits come before the one of what is far: none, as that stands apart.
const uint HEAD_APART = 64;

// How many coordinate bits come before the one of what is far: the first of each axis.
uint head_of(Stretches s) {
    uint alone = s.bits[0].x + s.bits[0].y + s.bits[0].z;
    uint paired = s.bits[1].x + s.bits[1].y + s.bits[1].z;
    if (alone > 1) return 1;
    return alone + paired > 2 ? 2 : 3;
}

// Whether it has an edge that is longer than the longest of the core.
bool is_longer_than_core(CodeSections s, Box b) {
    uint longest = max(max(s.reference.x, s.reference.y), s.reference.z);
    uint edge = 0;
    for (uint axis = 0; axis < 3; ++axis) edge = max(edge, octaves(b.hi[axis], b.lo[axis]));
    return edge > longest;
}

uint section_of(CodeSections s, Box b) {
    uvec3 lo = ordered(b.lo), hi = ordered(b.hi);
    if (is_inside(lo, hi, s.fences)) return SECTION_CORE;
    bool touches = all(lessThanEqual(lo, ordered(s.core.hi))) && all(greaterThanEqual(hi, ordered(s.core.lo)));
    uint section = touches ? SECTION_HUGE : SECTION_FAR;
    for (uint round = touches ? 0 : 1; round < 1; ++round) section = is_longer_than_core(s, b) ? SECTION_HUGE : SECTION_CORE;
    return section;
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
        uint of_head = plan.sections.head % HEAD_APART;
        uint behind = kind.bits - of_head;
        uvec2 head = of_head == 0 ? uvec2(0) : shift_right(code, behind);
        uvec2 rest = shift_right(bits_of(code, 64 - behind, behind), 2);
        uvec2 huge = uvec2(parts.section == SECTION_HUGE ? 1 : 0, 0);
        uvec2 beyond = uvec2(parts.section == SECTION_CORE ? 0 : 1, 0);
        code = shift_left(huge, kind.bits - 1) | shift_left(head, behind - 1) | shift_left(beyond, behind - 2) | rest;
    }
    return code;
}
#endif
