// What stands where a tree has nothing.
#ifndef HEDGEROW_BVH_EMPTY
#define HEDGEROW_BVH_EMPTY
#include "bvh/layout.glsl"

// The root of a tree without primitives.
Child empty_root() {
    return Child(uintBitsToFloat(uvec3(0x7F800000u)), 0, uintBitsToFloat(uvec3(0xFF800000u)), 0);
}

// A slot that no child names.
void mark_unused(Structure structure, uint slot) {
    Child unused = Child(uintBitsToFloat(uvec3(0x7F800000u)), UNUSED, uintBitsToFloat(uvec3(0xFF800000u)), UNUSED);
    structure.nodes[slot] = Node(unused, unused);
}
#endif
