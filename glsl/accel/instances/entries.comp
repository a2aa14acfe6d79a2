// One entry for each instance of a top level: its box in the world, and the root of its structure to begin at.
//
// reads   the instances and the structures that they name; where `ranges` is not 0, a VkAccelerationStructureBuildRangeInfoKHR
// writes  entries[0..capacity]; those without an instance are inactive
// needs   barriers before (the structures' builds) and after; any subgroup size
#version 460
#include "accel/world_box.glsl"

layout(push_constant, scalar) uniform EntriesArguments {
    uvec2 instances;   // or pointers to them
    Entries entries;
    uvec2 ranges;
    uint count;
    uint capacity;
    uint pointers;     // whether they are
};

bool is_finite_matrix(vec4 m[3]) {
    return is_finite(m[0].xyz) && is_finite(m[1].xyz) && is_finite(m[2].xyz) && is_finite(vec3(m[0].w, m[1].w, m[2].w));
}

// Of the instance at an address.
Entry entry_of(uvec2 given_at, uint i) {
    Entry entry = entry_left_out(i, given_at, INACTIVE);
    GivenInstance given = instance_of(entry);
    if (all(equal(given.structure, uvec2(0)))) return entry;
    entry.left_out = STATUS_BAD_INSTANCE;
    vec4 inverse[3];
    if (!is_finite_matrix(given.to_world) || !inverse_of(given.to_world, inverse)) return entry;
    Structure structure = Structure(given.structure);
    Header header = structure.header;
    bool is_known = header.kind == KIND_TRIANGLES || header.kind == KIND_BOXES || is_quantised(header.kind);
    if (header.magic != MAGIC || !is_known || has_instances(header.kind)) return entry;
    entry.left_out = INACTIVE;
    if (header.active_count == 0u || (header.status & STATUS_UNUSABLE) != 0u) return entry;
    uint slots = min(header.node_slots, INDEX_MASK) | form_of(header);
    Child whole = whole_part(header);
    Box b = world_box(given.to_world, structure, node_of(structure, slots, whole), slots, whole);
    // Too far away to be a number.
    entry.left_out = STATUS_BAD_INSTANCE;
    if (!is_finite(b.lo) || !is_finite(b.hi)) return entry;
    return entry_over(b, i, whole, slots, header.primitive_count, given_at);
}

void main() {
    uint i = invocation_number();
    if (i >= capacity) return;
    uint there = count;
    uvec2 from = instances;
    if (any(notEqual(ranges, uvec2(0)))) {
        Words range = Words(ranges);
        there = min(range.word[0], count);
        from = address_of(from, range.word[1], 1u);
    }
    if (i >= there) entries.entry[i] = entry_left_out(0xFFFFFFFFu, uvec2(0), INACTIVE);
    else if (pointers != 0u) entries.entry[i] = entry_of(Pointers(from).pointer[i], i);
    else entries.entry[i] = entry_of(address_of(from, i, 64u), i);
}
