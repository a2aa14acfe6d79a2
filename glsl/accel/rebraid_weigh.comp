#version 460
// What opening an entry would save: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

float half_area(Box b) {
    precise vec3 e = b.hi - b.lo;
    precise float area = e.x * e.y + e.y * e.z + e.z * e.x;
    return area;
}

Box unite(Box a, Box b) {
    return Box(min(a.lo, b.lo), max(a.hi, b.hi));
}

// The area that rays need not enter any more for each entry more, if the entry is opened once or twice: from the eight boxes
// below it, transformed.
float gain_of(Entry entry) {
    if (entry.left_out != 0u) return NO_GAIN;
    GivenInstance given = instance_of(entry);
    Structure structure = Structure(given.structure);
    uvec2 begin = begin_of(entry, structure);
    if (begin.y != 0u) return NO_GAIN;
    uint slots = structure.header.node_slots;
    Box nothing = Box(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
    float halves = 0.0, quarters = 0.0;
    Box whole = nothing;
    bool has_quarters = false;
    for (uint side = 0; side < 2; ++side) {
        Box part = nothing;
        for (uint quarter = 0; quarter < 2; ++quarter) {
            Box piece = nothing;
            for (uint eighth = 0; eighth < 2; ++eighth) {
                uint path = side | quarter << 1 | eighth << 2;
                Child at = Child(vec3(0), begin.x, vec3(0), 0);
                for (uint level = 0; level < FINE_LEVELS && at.count == 0u && at.index < slots; ++level) {
                    Node node = structure.nodes[at.index];
                    if ((path >> level & 1u) == 0u) at = node.left;
                    else at = node.right;
                    has_quarters = has_quarters || level > 0u;
                }
                piece = unite(piece, transformed_box(given.to_world, at.lo, at.hi));
            }
            quarters += half_area(piece);
            part = unite(part, piece);
        }
        halves += half_area(part);
        whole = unite(whole, part);
    }
    float allowed = tolerance * half_area(whole);
    precise float once = allowed - halves;
    precise float twice = (tolerance * allowed - quarters) * (1.0 / 3.0);
    float gain = has_quarters ? max(once, twice) : once;
    return gain > 0.0 && is_finite(vec3(gain)) ? gain : NO_GAIN;
}

void main() {
    uvec2 range = range_of_chunk(gl_WorkGroupID.x);
    for (uint i = range.x + gl_LocalInvocationIndex; i < range.y; i += gl_WorkGroupSize.x) {
        float gain = gains.value[i];
        if (gain == UNKNOWN) {
            gain = gain_of(entries.entry[i]);
            gains.value[i] = gain;
        }
        if (gain > 0.0) atomicAdd(state.histogram[round * CLASSES + class_of(gain)], 1u);
    }
}
