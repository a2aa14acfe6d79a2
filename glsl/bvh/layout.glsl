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
// What the leaves hold.
const uint KIND_TRIANGLES = 0x00020006u;
const uint KIND_BOXES = 0x00120006u;
const uint KIND_INSTANCES = 0x00220006u;
// The same in nodes of eight children as bytes (bvh/wide.glsl).
const uint KIND_TRIANGLES_8Q = 0x01080006u;
const uint KIND_BOXES_8Q = 0x01180006u;
const uint KIND_INSTANCES_8Q = 0x01280006u;
const uint MAX_DEPTH = 96;
// The count of a child that no tree has: its slot is unused.
const uint UNUSED = 0xFFFFFFFFu;
// Indices of nodes and records are below 2^27: what an instance knows of its structure lies in the bits above some of them.
const uint INDEX_BITS = 27;
const uint INDEX_MASK = (1u << INDEX_BITS) - 1u;
// In place of a leaf's count in those bits: it goes as far as records may be looked at.
const uint UP_TO_LAST = 31;
const uint FORM_BOXES = 1u << INDEX_BITS;
const uint FORM_LEFT_FIRST = 2u << INDEX_BITS;
const uint FORM_ALL_OPAQUE = 4u << INDEX_BITS;
const uint FORM_ANY_OPAQUE = 8u << INDEX_BITS;
const uint FORM_QUANTISED = 16u << INDEX_BITS;
// Of an instance of quantised nodes: all slots of a node.
const uint ALL_SLOTS = 0xFFu;

const uint STATUS_NON_FINITE = 1u << 0;
const uint STATUS_INDEX_OUT_OF_RANGE = 1u << 1;
const uint STATUS_TOO_DEEP = 1u << 2;
const uint STATUS_SPIN_RAN_OUT = 1u << 3;
const uint STATUS_BAD_INSTANCE = 1u << 4;
const uint STATUS_WRONG_VERSION = 1u << 5;
const uint STATUS_DEPTH_LIMITED = 1u << 6;
const uint STATUS_OUT_OF_ROOM = 1u << 7;
const uint STATUS_UNUSABLE = STATUS_TOO_DEEP | STATUS_SPIN_RAN_OUT | STATUS_WRONG_VERSION;

const uint GEOMETRY_OPAQUE = 1u << 0;

struct Child {
    vec3 lo;
    uint index;   // node slot, or first record of the leaf
    vec3 hi;
    uint count;   // 0: inner node; otherwise records in the leaf
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

struct BoxRecord {
    vec3 lo;
    vec3 hi;
    uint primitive;
};

struct Instance {
    vec4 to_object[3];
    vec4 to_world[3];
    uvec2 structure;
    uint index_and_mask;      // custom index, mask << 24
    uint offset_and_flags;    // offset in the shader binding table, flags << 24
    uint instance;
    // Where to begin in the structure: a Child's index, its count or UP_TO_LAST above. Of quantised nodes a node's index, and above it
    // and above `records` which of its slots.
    uint start;
    uint slots;               // nodes of the structure, its FORM above
    uint records;             // of the structure that may be looked at
};

struct GeometryEntry {
    uint first;
    uint flags;
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
    uint inner_nodes;
    uint geometry_count;
    uint geometry_flags;      // what all geometries have, what any has << 8
    uint build_flags;
    float area_scale;
    float cost;
    float built_cost;
    float built_area;
    uint split_from;
    uint child_order;         // 1: left children are those that rays look into first that end at any hit
    uint pairs;               // of quantised trees of triangles: records that hold two
    uint near_node;           // of a top level with something far: the node over what is not; otherwise 0
    uint far_sides;           // on which sides of that node something is: bits 2 * axis, and 1 more on the positive side
    uint reserved[4];
};

// What is far on one side: boxes of all sides lie behind the records, if there is anything far.
struct FarBox {
    vec3 lo;
    vec3 hi;
};

const uint FAR_SIDES = 6;
const uint FAR_BOX_BYTES = 24;

layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer Structure {
    Header header;
    Node nodes[];
};

layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Triangles { Triangle triangle[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) nonprivate buffer BoxRecords { BoxRecord box[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Instances { Instance instance[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) nonprivate buffer GeometryTable { GeometryEntry entry[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) nonprivate buffer FarBoxes { FarBox box[]; };

// base + index * stride: no 64-bit integers, which a device need not have.
uvec2 address_of(uvec2 base, uint index, uint stride) {
    uint high, low, carry;
    umulExtended(index, stride, high, low);
    base.x = uaddCarry(base.x, low, carry);
    base.y += high + carry;
    return base;
}

// Where the records of a structure with this many node slots begin: behind the nodes.
uvec2 records_at(uvec2 structure, uint node_slots) {
    return address_of(address_of(structure, 2u, 64u), node_slots, 64u);
}

bool is_quantised(uint kind) {
    return kind == KIND_TRIANGLES_8Q || kind == KIND_BOXES_8Q || kind == KIND_INSTANCES_8Q;
}

bool has_boxes(uint kind) {
    return kind == KIND_BOXES || kind == KIND_BOXES_8Q;
}

// Whether it is a top level.
bool has_instances(uint kind) {
    return kind == KIND_INSTANCES || kind == KIND_INSTANCES_8Q;
}

uint record_bytes(uint kind) {
    return has_instances(kind) ? 128u : has_boxes(kind) ? 28u : 40u;
}

// What rays need of a structure's header, beside how many nodes it has.
uint form_of(Header header) {
    uint form = has_boxes(header.kind) ? FORM_BOXES : 0u;
    if (is_quantised(header.kind)) form |= FORM_QUANTISED;
    if (header.child_order != 0u) form |= FORM_LEFT_FIRST;
    if ((header.geometry_flags & GEOMETRY_OPAQUE) != 0u) form |= FORM_ALL_OPAQUE;
    if ((header.geometry_flags >> 8 & GEOMETRY_OPAQUE) != 0u) form |= FORM_ANY_OPAQUE;
    return form;
}

// Where the records of a structure of any kind begin.
uvec2 records_of_kind(uvec2 structure, uint kind, uint node_slots) {
    return address_of(address_of(structure, 1u, 128u), node_slots, is_quantised(kind) ? 80u : 64u);
}

// Where an instance begins: a Child's index and count; of quantised nodes a node, and which of its slots.
uvec2 begin_at(uint start, uint slots, uint records) {
    uint index = start & INDEX_MASK, above = start >> INDEX_BITS;
    uint of_eight = above | records >> INDEX_BITS << 32u - INDEX_BITS, of_two = above == UP_TO_LAST ? records - index : above;
    return uvec2(index, (slots & FORM_QUANTISED) != 0u ? of_eight : of_two);
}

Triangles triangles_of(Structure structure) {
    return Triangles(records_at(uvec2(structure), structure.header.node_slots));
}

// Which of several geometries a primitive is of.
uint geometry_index_of(GeometryTable table, uint count, uint primitive) {
    uint at = 0, end = count;
    for (uint halving = 0; halving < 32 && at + 1 < end; ++halving) {
        uint middle = at + (end - at) / 2;
        if (table.entry[middle].first <= primitive) at = middle;
        else end = middle;
    }
    return at;
}

// Where the table of geometries lies, if there are several: behind the records. An address, for a reference made of another
// reference makes SwiftShader crash.
uvec2 geometry_table_address(uvec2 structure, uint kind, uint node_slots, uint primitive_count, uint pairs) {
    // A pair takes 16 bytes more than one triangle.
    uint singly = primitive_count - min(pairs, primitive_count);
    return address_of(address_of(records_of_kind(structure, kind, node_slots), singly, record_bytes(kind)), pairs, 16u);
}

uvec2 geometry_table_of(uvec2 structure, Header header) {
    return geometry_table_address(structure, header.kind, header.node_slots, header.primitive_count, header.pairs);
}

// Where the boxes of what is far lie: a top level has one geometry, and so no table.
uvec2 far_boxes_of(uvec2 structure, Header header) {
    return geometry_table_of(structure, header);
}
#endif
