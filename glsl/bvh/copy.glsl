// Copies of structures, whose sizes only the device knows: how many bytes a header stands for, what it becomes, and bytes moved
// by all workgroups of a dispatch together, however many they are.
#ifndef HEDGEROW_BVH_COPY
#define HEDGEROW_BVH_COPY
#include "gpu/pass.glsl"
#include "gpu/grid.glsl"
#include "bvh/layout.glsl"
#include "bvh/empty.glsl"

// Eight bytes: what every part of a structure is aligned to, in whatever it is copied from or to.
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Pairs { uvec2 pair[]; };

// Whether a header is one of a binary tree of this layout: what else may lie there says nothing of sizes.
bool is_binary(Header header) {
    return header.magic == MAGIC &&
           (header.kind == KIND_TRIANGLES || header.kind == KIND_BOXES || header.kind == KIND_INSTANCES);
}

// Or one of quantised nodes.
bool is_structure(Header header) {
    return is_binary(header) || header.magic == MAGIC && is_quantised(header.kind);
}

// Bytes of a structure, as two words: an address behind address 0.
uvec2 structure_bytes(Header header) {
    uvec2 bytes = address_of(geometry_table_of(uvec2(0), header), header.geometry_count > 1 ? header.geometry_count : 0, 8);
    return address_of(bytes, header.near_node != 0 ? FAR_SIDES : 0, FAR_BOX_BYTES);
}

// Copies a number of bytes (two words; a multiple of 4) between addresses that are multiples of 8. Pieces are found by address, as
// indices into memory are signed and end at 2^31.
void copy_bytes(uvec2 from, uvec2 to, uvec2 bytes) {
    uint pairs = bytes.x >> 3 | bytes.y << 29;
    for (uint first = group_number() * grid_piece(); first < pairs; first += group_count() * grid_piece()) {
        Pairs source = Pairs(address_of(from, first, 8));
        Pairs target = Pairs(address_of(to, first, 8));
        for (uint i = gl_LocalInvocationIndex; i < min(grid_piece(), pairs - first); i += gl_WorkGroupSize.x) {
            target.pair[i] = source.pair[i];
        }
    }
    if ((bytes.x & 4u) != 0u && invocation_number() == 0) {
        Words(address_of(to, pairs, 8)).word[0] = Words(address_of(from, pairs, 8)).word[0];
    }
}

// The header of a structure of nothing that stands for what this version cannot read.
Header header_of_wrong_version() {
    const uint reserved[4] = uint[4](0, 0, 0, 0);
    return Header(MAGIC, KIND_TRIANGLES, STATUS_WRONG_VERSION, 0, empty_root(), 0, 1, 0, 0, 1, 0, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0, reserved);
}

// One invocation of the dispatch writes it.
void write_wrong_version(Structure structure) {
    if (invocation_number() != 0) return;
    structure.header = header_of_wrong_version();
    mark_unused(structure, 0);
}

// Whether there is anything in it, and it can be traced.
bool holds_something(Header header) {
    return header.active_count != 0 && (header.status & STATUS_UNUSABLE) == 0u;
}

// The header of the compacted structure.
Header compacted(Header header) {
    if (!holds_something(header)) {
        header.root = empty_root();
        header.active_count = 0;
        header.inner_nodes = 0;
        header.near_node = 0;
        header.far_sides = 0;
    }
    header.primitive_count = header.active_count;
    header.pairs = min(header.pairs, header.active_count);
    header.node_slots = max(header.inner_nodes, 1);
    // A root that is a node is the first. What is near is its left child.
    if (header.root.count == 0) header.root.index = 0;
    if (header.near_node != 0) header.near_node = 1;
    return header;
}
#endif
