// The bytes of a Bvh2, as src/bvh/layout.rs describes them.
#ifndef HEDGEROW_BVH_LAYOUT
#define HEDGEROW_BVH_LAYOUT
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_KHR_memory_scope_semantics : require
#pragma use_vulkan_memory_model

const uint MAGIC = 0x72676468u;
const uint KIND_BVH2 = 0x00020002u;
const uint MAX_DEPTH = 96;

const uint STATUS_NON_FINITE = 1u << 0;
const uint STATUS_INDEX_OUT_OF_RANGE = 1u << 1;
const uint STATUS_TOO_DEEP = 1u << 2;
const uint STATUS_SPIN_RAN_OUT = 1u << 3;

struct Child {
    vec3 lo;
    uint index;   // node slot, or first triangle of the leaf
    vec3 hi;
    uint count;   // 0: inner node; otherwise triangles in the leaf
};

struct Node {
    Child left;
    Child right;
};

struct Triangle {
    vec3 v0;
    vec3 v1;
    vec3 v2;
    uint primitive;
};

struct Header {
    uint magic;
    uint kind;
    uint status;
    uint primitive_count;
    Child root;
    uint active_count;
    uint node_slots;
    uint code_bits;
    uint reserved[17];
};

layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer Structure {
    Header header;
    Node nodes[];
};

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Triangles {
    Triangle triangle[];
};

// Where the triangles of a structure with so many node slots begin: behind the nodes. No 64-bit integers, which a device need
// not have.
Triangles triangles_at(uvec2 structure, uint node_slots) {
    uint high, low, carry, carry2;
    umulExtended(node_slots, 64u, high, low);
    structure.x = uaddCarry(structure.x, low, carry);
    structure.x = uaddCarry(structure.x, 128u, carry2);
    structure.y += high + carry + carry2;
    return Triangles(structure);
}

Triangles triangles_of(Structure structure) {
    return triangles_at(uvec2(structure), structure.header.node_slots);
}
#endif
