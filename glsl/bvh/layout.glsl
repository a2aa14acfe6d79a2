// The bytes of a Bvh2, as src/bvh/layout.rs describes them.
#ifndef HEDGEROW_BVH_LAYOUT
#define HEDGEROW_BVH_LAYOUT
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require

const uint MAGIC = 0x72676468u;
const uint KIND_BVH2 = 0x00020001u;
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
    uint primitive;
    vec3 v1;
    uint geometry;
    vec3 v2;
    uint flags;
};

struct Header {
    uint magic;
    uint kind;
    uint status;
    uint primitive_count;
    Child root;
    uint active;
    uint node_slots;
    uint code_bits;
    uint reserved[17];
};

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Structure {
    Header header;
    Node nodes[];
};

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Triangles {
    Triangle triangle[];
};

// Where the triangles of a structure begin: behind its nodes. No 64-bit integers, which a device need not have.
Triangles triangles_of(Structure structure) {
    uint high, low, slots = structure.header.node_slots;
    umulExtended(slots, 64u, high, low);
    uvec2 address = uvec2(structure);
    uint carry, carry2;
    address.x = uaddCarry(address.x, low, carry);
    address.x = uaddCarry(address.x, 128u, carry2);
    address.y += high + carry + carry2;
    return Triangles(address);
}
#endif
