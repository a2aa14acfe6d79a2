// How large a structure is with the head and the handles that it is serialised with.
#ifndef HEDGEROW_ACCEL_SERIALIZED
#define HEDGEROW_ACCEL_SERIALIZED
#include "bvh/copy.glsl"

// The writer and its version, two sizes, and how many handles follow.
const uint HEAD_PAIRS = 7;

uint handle_count(Header header) {
    return has_instances(header.kind) ? header.primitive_count : 0;
}

uvec2 serialized_bytes(Header header) {
    return address_of(structure_bytes(header), HEAD_PAIRS + handle_count(header), 8);
}
#endif
