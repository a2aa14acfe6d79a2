// Re-braiding (Benthin, Woop, Wald 2017): before a top level is built, entries whose boxes are loose are opened, each replaced
// by the two parts of what it begins at (accel/parts.glsl), while the budget lasts. src/accel/rebraid.rs records the rounds, and
// src/accel/twin/mod.rs is the twin.
//
//   fences  reads entries; one workgroup                        writes the sample, near
//   weigh   reads entries, near, the structures below           writes gains of all entries, how they are cut, histogram[0]
//   select  reads gains, histogram[round]                       writes sums[chunk]: entries that the round opens
//   list    reads gains, histogram[round], sums                 writes count[round + 1]; in place of the gains of the entries
//                                                               that come to be, the numbers of those that are opened
//   open    reads that list, histogram[round], near, the        writes entries, their gains, how they are cut, histogram[round + 1]
//           structures below
//
// Opening takes long. So what is opened is listed first: every invocation then has an entry to open, and none waits for another. The boxes
// that an entry's own is made of also say what opening it saves; how it is cut is found for that, and kept.
//
// What a round may spend is its share of what is left, so that the loosest entries are opened deeper than others are at all.
// What lies beyond the fences of most entries (bvh/codes/quartiles.glsl) is opened last, as few rays come there, however large it is.
// Entries are opened in the order of their gain, by 512 classes of it, within a class in that of their index: nothing depends
// on who comes first.
//
// needs  one barrier between each two; the state zeroed before the first; any subgroup size; `chunks` workgroups
#ifndef HEDGEROW_ACCEL_REBRAID
#define HEDGEROW_ACCEL_REBRAID
#include "accel/world_box.glsl"

const bool HAS_SECTIONS = true;
#include "bvh/codes/quartiles.glsl"

const uint CLASSES = 512;
const uint ROUNDS = 4;
const uint CHUNKS_AT_MOST = 256;
const uint NO_GAIN = 0;
// Of what is far, at most: 2^-126.
const float FAR_GAIN = 1.1754943508222875e-38;

BUFFER RebraidState {
    uint count[ROUNDS + 1];   // the first is not read
    uint histogram[ROUNDS * CLASSES];
    // What is opened for sure, and what is in the class of which some are.
    uint sums[2 * CHUNKS_AT_MOST];
    // Within the fences.
    Box near;
};

layout(push_constant, scalar) uniform RebraidArguments {
    Entries entries;
    Words gains;   // bits of floats; where something is gained, above 0
    RebraidState state;
    Sample table;
    uint capacity;
    uint this_round;   // of the dispatch
    uint chunks;
    uint instance_count;
};

// A number of each invocation, or two.
shared uint of_lane[2 * gl_WorkGroupSize.x];

uint entries_before(uint round) {
    return round == 0u ? instance_count : state.count[round];
}

// Whether nothing is left to be opened, for lack of budget or of gain.
bool is_over(uint round) {
    uint count = entries_before(round);
    return count >= capacity || round > 0u && count == entries_before(round - 1u);
}

uint class_of(uint gain) {
    return gain >> 22 & (CLASSES - 1u);
}

// A range cut into as many parts as there are invocations (or workgroups), in order.
uvec2 part_of(uvec2 range, uint part, uint parts) {
    uint size = (range.y - range.x + parts - 1u) / parts;
    return uvec2(min(range.x + part * size, range.y), min(range.x + (part + 1u) * size, range.y));
}

uvec2 range_of_chunk(uint round, uint chunk) {
    return part_of(uvec2(0u, entries_before(round)), chunk, chunks);
}

// What a round opens: all of the classes above `partial`, and of that class the first `quota`; everything, if the share suffices.
struct Selection {
    uint partial;
    uint quota;
};

Selection selection_of(uint round) {
    uint left = capacity - entries_before(round);
    uint share = (left + (ROUNDS - round) - 1u) / (ROUNDS - round);
    // From the highest class down: first by the sums of an invocation's classes, then class by class.
    uint lanes = gl_WorkGroupSize.x;
    uvec2 own = part_of(uvec2(0u, CLASSES), gl_LocalInvocationIndex, lanes);
    uint sum = 0u;
    for (uint i = own.x; i < own.y; ++i) sum += state.histogram[round * CLASSES + CLASSES - 1u - i];
    of_lane[gl_LocalInvocationIndex] = sum;
    barrier();
    uint lane = 0u;
    while (lane < lanes && of_lane[lane] <= share) share -= of_lane[lane++];
    barrier();
    uvec2 at = part_of(uvec2(0u, CLASSES), lane, lanes);
    for (uint i = at.x; i < at.y; ++i) {
        uint there = state.histogram[round * CLASSES + CLASSES - 1u - i];
        if (there > share) return Selection(CLASSES - 1u - i, share);
        share -= there;
    }
    return Selection(0u, 0xFFFFFFFFu);
}

// x: opened for sure; y: in the class of which some are.
uvec2 kind_of(uint gain, Selection s) {
    if (gain == NO_GAIN) return uvec2(0);
    uint bucket = class_of(gain);
    return uvec2(bucket > s.partial ? 1u : 0u, bucket == s.partial ? 1u : 0u);
}

uvec2 kinds_in(uvec2 range, Selection s) {
    uvec2 sum = uvec2(0);
    for (uint i = range.x; i < range.y; ++i) sum += kind_of(gains.word[i], s);
    return sum;
}

bool is_apart(Box a, Box b) {
    return any(lessThan(ordered(a.hi), ordered(b.lo))) || any(greaterThan(ordered(a.lo), ordered(b.hi)));
}

void rebraid_fences() {
    if (gl_LocalInvocationIndex == 0) begin_sample();
    next_phase();
    uint taken = min(instance_count, SECTION_SAMPLE);
    for (uint i = gl_LocalInvocationIndex; i < taken; i += gl_WorkGroupSize.x) {
        Entry entry = entries.entry[sampled_at(i, taken, instance_count)];
        take_sample(table, i, entry.left_out == 0u, Box(entry.lo, entry.hi));
    }
    next_phase();
    Box near = EVERYWHERE;
    if (sampled_count != 0) near = fences_beyond(table, taken, find_quartiles(table, taken));
    if (gl_LocalInvocationIndex == 0) state.near = near;
}

// What an entry begins at, as a part without a box.
Child part_of_entry(Entry entry) {
    uvec2 begin = begin_at(entry.start, entry.slots, entry.records);
    return Child(vec3(0), begin.x, vec3(0), begin.y);
}

// What opening an entry to these halves saves.
uint gain_of(Entry entry, Halves halves) {
    if (!(halves.saved > 0.0) || !is_finite(vec3(halves.saved))) return NO_GAIN;
    return floatBitsToUint(is_apart(Box(entry.lo, entry.hi), state.near) ? min(halves.saved, FAR_GAIN) : halves.saved);
}

void count_gain(uint gain, uint round) {
    if (gain != NO_GAIN) atomicAdd(state.histogram[round * CLASSES + class_of(gain)], 1u);
}

// Opens entry i: its second part gets the place `behind`. Both are weighed for the next round, if there is one.
void open(uint i, uint behind, uint round) {
    Entry parent = entries.entry[i];
    GivenInstance given = instance_of(parent);
    Structure structure = Structure(given.structure);
    uint slots = parent.slots;
    Child opened = part_of_entry(parent);
    QuantisedNode node = node_of(structure, slots, opened);
    bool is_last = round + 1u == ROUNDS;
    Child parts[2];
    // What has a gain can be opened.
    open_part(structure, node, slots, opened, parent.cut, parts);
    for (uint side = 0; side < 2; ++side) {
        uint to = side == 0u ? i : behind;
        QuantisedNode of_part = node_of(structure, slots, parts[side], opened.index, node);
        uint cut = is_last ? 0u : cut_of(of_part, slots, parts[side]);
        Halves halves = halves_of(given.to_world, structure, of_part, slots, parts[side], cut);
        Box b = united(halves.of[0], halves.of[1]);
        Entry entry = entry_over(b, parent.instance, parts[side], slots, parent.records, parent.given);
        entry.cut = cut;
        entries.entry[to] = entry;
        if (!is_last) {
            uint gain = opens(slots, parts[side], cut) ? gain_of(entry, halves) : NO_GAIN;
            gains.word[to] = gain;
            count_gain(gain, round + 1u);
        }
    }
}

void rebraid_weigh(uint chunk) {
    if (is_over(0u)) return;
    uvec2 range = range_of_chunk(0u, chunk);
    for (uint i = range.x + gl_LocalInvocationIndex; i < range.y; i += gl_WorkGroupSize.x) {
        Entry entry = entries.entry[i];
        uint gain = NO_GAIN;
        if (entry.left_out == 0u) {
            GivenInstance given = instance_of(entry);
            Structure structure = Structure(given.structure);
            Child part = part_of_entry(entry);
            QuantisedNode node = node_of(structure, entry.slots, part);
            uint cut = cut_of(node, entry.slots, part);
            if (opens(entry.slots, part, cut)) {
                gain = gain_of(entry, halves_of(given.to_world, structure, node, entry.slots, part, cut));
                entries.entry[i].cut = cut;
            }
        }
        gains.word[i] = gain;
        count_gain(gain, 0u);
    }
}

void rebraid_select(uint round, uint chunk) {
    if (is_over(round)) return;
    Selection s = selection_of(round);
    uvec2 kinds = kinds_in(part_of(range_of_chunk(round, chunk), gl_LocalInvocationIndex, gl_WorkGroupSize.x), s);
    of_lane[2u * gl_LocalInvocationIndex] = kinds.x;
    of_lane[2u * gl_LocalInvocationIndex + 1u] = kinds.y;
    barrier();
    if (gl_LocalInvocationIndex < 2u) {
        uint sum = 0u;
        for (uint lane = 0; lane < gl_WorkGroupSize.x; ++lane) sum += of_lane[2u * lane + gl_LocalInvocationIndex];
        state.sums[2u * chunk + gl_LocalInvocationIndex] = sum;
    }
}

void rebraid_list(uint round, uint chunk) {
    uint count = entries_before(round);
    if (is_over(round)) {
        if (chunk == 0u && gl_LocalInvocationIndex == 0u) state.count[round + 1u] = count;
        return;
    }
    Selection s = selection_of(round);
    // Each invocation lists what is opened of a run of entries, behind what is of those before it.
    uvec2 range = part_of(range_of_chunk(round, chunk), gl_LocalInvocationIndex, gl_WorkGroupSize.x);
    uvec2 kinds = kinds_in(range, s);
    of_lane[2u * gl_LocalInvocationIndex] = kinds.x;
    of_lane[2u * gl_LocalInvocationIndex + 1u] = kinds.y;
    uvec2 before = uvec2(0), all = uvec2(0);
    for (uint other = 0; other < chunks; ++other) {
        uvec2 sum = uvec2(state.sums[2u * other], state.sums[2u * other + 1u]);
        all += sum;
        if (other < chunk) before += sum;
    }
    barrier();
    for (uint lane = 0; lane < gl_LocalInvocationIndex; ++lane) before += uvec2(of_lane[2u * lane], of_lane[2u * lane + 1u]);
    for (uint i = range.x; i < range.y; ++i) {
        uvec2 kind = kind_of(gains.word[i], s);
        if (kind.x != 0u || kind.y != 0u && before.y < s.quota) gains.word[count + before.x + min(before.y, s.quota)] = i;
        before += kind;
    }
    if (chunk == 0u && gl_LocalInvocationIndex == 0u) state.count[round + 1u] = count + all.x + min(all.y, s.quota);
}

// Counts the gains that the round has left, of a part of the classes, for the next one.
void count_what_is_left(uint round, uint chunk) {
    Selection s = selection_of(round);
    uvec2 range = part_of(uvec2(0u, CLASSES), chunk, chunks);
    for (uint i = range.x + gl_LocalInvocationIndex; i < range.y; i += gl_WorkGroupSize.x) {
        uint there = state.histogram[round * CLASSES + i];
        uint left = i < s.partial ? there : i == s.partial ? there - min(there, s.quota) : 0u;
        if (left != 0u) atomicAdd(state.histogram[(round + 1u) * CLASSES + i], left);
    }
}

void rebraid_open(uint round, uint chunk) {
    if (is_over(round)) return;
    if (round + 1u < ROUNDS) count_what_is_left(round, chunk);
    uvec2 range = part_of(uvec2(entries_before(round), entries_before(round + 1u)), chunk, chunks);
    for (uint i = range.x + gl_LocalInvocationIndex; i < range.y; i += gl_WorkGroupSize.x) open(gains.word[i], i, round);
}
#endif
