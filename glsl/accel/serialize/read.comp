#version 460
// The structure out of its bytes, if this version wrote them: see accel/serialize.glsl for the contract.
#include "accel/serialize.glsl"

// Whether the head is ours, and its sizes are those of each other and of the structure's own header.
bool is_ours() {
    SerializedHead head = memory.head;
    for (uint i = 0; i < 8; ++i) {
        if (head.version[i] != version[i]) return false;
    }
    uint handles = head.handle_count.x;
    if (head.serialized_bytes != address_of(head.structure_bytes, HEAD_PAIRS + handles, 8)) return false;
    Header header = SerializedHeader(serialized_at(handles)).header;
    return is_structure(header) && head.handle_count == uvec2(handle_count(header), 0) &&
           head.structure_bytes == structure_bytes(header);
}

void main() {
    if (!is_ours()) {
        write_wrong_version(structure);
        return;
    }
    copy_bytes(serialized_at(memory.head.handle_count.x), uvec2(structure), memory.head.structure_bytes);
}
