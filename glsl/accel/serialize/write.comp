#version 460
// The structure's bytes with their head: see accel/serialize.glsl for the contract.
#include "accel/serialize.glsl"

void main() {
    Header header = structure.header;
    bool is_sound = is_structure(header);
    if (!is_sound) header = header_of_wrong_version();
    uint handles = handle_count(header);
    if (invocation_number() == 0) {
        for (uint i = 0; i < 8; ++i) memory.head.version[i] = is_sound ? version[i] : 0;
        memory.head.serialized_bytes = serialized_bytes(header);
        memory.head.structure_bytes = structure_bytes(header);
        memory.head.handle_count = uvec2(handles, 0);
    }
    if (!is_sound) return;
    Instances instances = instances_of(header);
    for (uint k = 0, i = grid_item(0); i < handles; i = grid_item(++k)) {
        memory.handle[i] = instances.instance[i].structure;
    }
    copy_bytes(uvec2(structure), serialized_at(handles), structure_bytes(header));
}
