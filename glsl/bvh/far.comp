#version 460
// Tells in the header of a top level in nodes of two what is far of what its root holds, and writes the boxes of that behind the records. Of nodes of
// eight bvh/wide/far.glsl does it. src/bvh/far.rs says what it is for and records it, src/bvh/twin/far.rs is the twin.
//
// reads   nodes
// writes  the header; boxes, where something is far
// needs   one barrier before; one workgroup, of which one invocation does it
#define HEDGEROW_ONE_WORKGROUP
#include "bvh/far.glsl"

layout(push_constant, scalar) uniform FarArguments {
    Structure structure;
    uint is_update;   // then what has no boxes yet gets none: there may be no room for them
};

// src/bvh/far.rs
const uint MOST_PARTS = 8;

FarBox found[FAR_SIDES];

// The sides to which something is far, a bit each, with the boxes of it; 0 where not all is far that the root holds beside what is near.
uint sides_of_far(Node root, float scale) {
    for (uint side = 0; side < FAR_SIDES; ++side) found[side] = far_box_of_nothing();
    Child waiting[MOST_PARTS];
    waiting[0] = root.right;
    uint count = 1, parts = 1, sides = 0;
    for (uint turn = 0; turn < 2 * MOST_PARTS && count != 0; ++turn) {
        Child other = waiting[--count];
        uint side = side_of(root.left, other, scale);
        if (side != ON_NO_SIDE) {
            found[side] = FarBox(min(found[side].lo, other.lo), max(found[side].hi, other.hi));
            sides |= 1u << side;
            parts++;
        } else if (other.count == 0 && parts + count + 2 <= MOST_PARTS) {
            // What lies on both sides reaches over what is near: its parts may be far.
            Node node = structure.nodes[other.index];
            waiting[count++] = node.right;
            waiting[count++] = node.left;
        } else {
            return 0;
        }
    }
    return sides;
}

void main() {
    if (gl_LocalInvocationIndex != 0) return;
    Header header = structure.header;
    bool has_room = is_update == 0 || header.near_node != 0;
    if (header.magic != MAGIC || header.kind != KIND_INSTANCES || !has_room) return;
    uint near_node = 0, sides = 0;
    if (header.active_count != 0 && header.root.count == 0) {
        Node root = structure.nodes[header.root.index];
        if (root.left.count == 0) {
            near_node = root.left.index;
            sides = sides_of_far(root, header.area_scale);
        }
    }
    structure.header.near_node = sides == 0 ? 0 : near_node;
    structure.header.far_sides = sides;
    FarBoxes boxes = FarBoxes(far_boxes_of(uvec2(structure), header));
    for (uint side = 0; side < FAR_SIDES && sides != 0; ++side) boxes.box[side] = found[side];
}
