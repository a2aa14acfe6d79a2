// Structures as bytes that outlive their addresses, as Vulkan lays them out: who wrote it and by which version, the bytes of it
// all and of the structure, how many handles follow, the handles, the structure. src/accel/serialize.rs records the steps and
// holds the twin.
//
//   write    reads the structure            writes the memory
//   read     reads the memory               writes the structure, with the handles of when it was written
//   handles  reads the memory's handles     writes them into the instances of the structure
//
// The handles are the addresses of the structures below a top level, one a record. Memory that something else wrote becomes an
// empty structure with the status WRONG_VERSION; what is not a structure is written with a version that no library has.
//
// needs  one barrier before, between read and handles, and after; any number of workgroups; any subgroup size
#ifndef HEDGEROW_ACCEL_SERIALIZE
#define HEDGEROW_ACCEL_SERIALIZE
#include "accel/serialized.glsl"

struct SerializedHead {
    uint version[8];
    uvec2 serialized_bytes;
    uvec2 structure_bytes;
    uvec2 handle_count;
};

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Memory {
    SerializedHead head;
    uvec2 handle[];
};

// A structure's header in the memory: a Structure wants addresses that are multiples of 16.
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer SerializedHeader { Header header; };

layout(push_constant, scalar) uniform SerializeArguments {
    Structure structure;
    Memory memory;
    uint version[8];   // ours
};

// Where the structure begins in the memory.
uvec2 serialized_at(uint handles) {
    return address_of(uvec2(memory), HEAD_PAIRS + handles, 8);
}

Instances instances_of(Header header) {
    return Instances(records_of_kind(uvec2(structure), header.kind, header.node_slots));
}
#endif
