#version 460
// The leaves of the static tree that triangles of objects are in; workgroups share the triangles. See kdtree/merge.glsl.
//
// Boxes are walked down, and what is left of the triangle in the leaf's cell decides, so that the leaves do not depend on the way.
#include "kdtree/merge.glsl"

struct Place {
    Box cell;
    uint id;
    uint node;
    uint depth;
};

void kd_find(uint j, Box root) {
    KdState state = build_state();
    KdMerge merge = merge_state();
    KdStructure structure = KdStructure(structure_address);
    KdReference r = references_of(0u).reference[j];
    Corners corners = corners_of_record(r.record);
    Place waiting[KD_MAX_DEPTH + 1];
    uint count = 0;
    Place place = Place(root, ROOT_ID, structure.header.node_count > 0u ? 0u : NONE, 0u);
    // Each turn is a node or an empty leaf.
    uint turns = 2u * structure.header.node_count + 1u;
    for (uint turn = 0; turn < turns; ++turn) {
        KdNode node = KdNode(0u, KD_LEAF);
        if (place.node != NONE) node = structure.nodes[place.node];
        if (!kd_is_leaf(node)) {
            uint axis = node.second & 3u, child = node.second >> 4;
            float plane = uintBitsToFloat(node.first);
            bool left_is_empty = (node.second & 4u) != 0u, right_is_empty = (node.second & 8u) != 0u;
            Place left = place, right = place;
            half_cells(place.cell, axis, plane, left.cell, right.cell);
            left.id = id_of(place.node, 0u);
            right.id = id_of(place.node, 1u);
            left.node = left_is_empty ? NONE : child;
            right.node = right_is_empty ? NONE : child + (left_is_empty ? 0u : 1u);
            left.depth = place.depth + 1u;
            right.depth = place.depth + 1u;
            bool is_left = r.lo[axis] <= plane, is_right = r.hi[axis] >= plane;
            if (is_left && is_right) waiting[count++] = right;
            place = right;
            if (is_left) place = left;
            continue;
        }
        Box part;
        if (clip_triangle(corners, state.reach, place.cell, part)) {
            uint at = atomicAdd(merge.wanted_pairs, 1u);
            if (at < merge.pair_capacity) {
                KdPairs(merge.pairs).pair[at] = KdPair(place.cell.lo, place.node, place.cell.hi, place.depth);
                write_key(at, place.id, j);
                Words(merge.values).word[at] = at;
            }
        }
        if (count == 0u) return;
        place = waiting[--count];
    }
}

void main() {
    uint count = build_state().active_count, stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    Box root = merged_cell();
    for (uint j = gl_GlobalInvocationID.x; j < count; j += stride) kd_find(j, root);
}
