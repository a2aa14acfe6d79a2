#version 460
// Opens what the round has selected: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

// The entry over one child of the node that another begins at.
Entry entry_over(Entry parent, vec4 m[3], Structure structure, Child child) {
    Box b = world_box(m, structure, child);
    return Entry(b.lo, parent.instance, b.hi, child.index, child.count, 0u, parent.given);
}

void open(uint i, uint behind) {
    Entry entry = entries.entry[i];
    GivenInstance given = instance_of(entry);
    Structure structure = Structure(given.structure);
    uint slot = begin_of(entry, structure).x;
    if (slot >= structure.header.node_slots) return;
    Node node = structure.nodes[slot];
    entries.entry[i] = entry_over(entry, given.to_world, structure, node.left);
    entries.entry[behind] = entry_over(entry, given.to_world, structure, node.right);
    gains.value[i] = UNKNOWN;
    gains.value[behind] = UNKNOWN;
}

// One invocation goes over a chunk's entries in their order: what is opened is few, and what is written is theirs alone.
void main() {
    if (gl_LocalInvocationIndex != 0u) return;
    Selection s = selection_of_round();
    uint count = count_of_entries();
    uvec2 before = uvec2(0), all = uvec2(0);
    for (uint chunk = 0; chunk < chunks; ++chunk) {
        uvec2 sum = uvec2(state.sums[2u * chunk], state.sums[2u * chunk + 1u]);
        all += sum;
        if (chunk < gl_WorkGroupID.x) before += sum;
    }
    uvec2 range = range_of_chunk(gl_WorkGroupID.x);
    for (uint i = range.x; i < range.y; ++i) {
        uvec2 kind = kind_of(gains.value[i], s);
        if (kind.x != 0u || kind.y != 0u && before.y < s.quota) open(i, count + before.x + min(before.y, s.quota));
        before += kind;
    }
    if (gl_WorkGroupID.x == 0u) state.count[round + 1u] = count + all.x + min(all.y, s.quota);
}
