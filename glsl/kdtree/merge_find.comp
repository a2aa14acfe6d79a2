#version 460
// The leaves of the static tree that triangles of objects without trees are in; workgroups share the triangles. See
// kdtree/merge.glsl.
//
// Boxes are walked down, and what is left of the triangle in the leaf's cell decides, so that the leaves do not depend on the way.
#include "kdtree/merge.glsl"

void kd_find(uint j, Place root) {
    KdState state = build_state();
    KdReference r = references_of(0u).reference[j];
    Corners corners = corners_of_record(r.record);
    Place waiting[KD_MAX_DEPTH + 1];
    uint count = 0;
    Place place = root;
    // Each turn is a node or an empty leaf.
    uint turns = 2u * KdStructure(structure_address).header.node_count + 1u;
    for (uint turn = 0; turn < turns; ++turn) {
        KdNode node = node_of(place);
        if (!kd_is_leaf(node)) {
            uint axis = node.second & 3u;
            float plane = uintBitsToFloat(node.first);
            Place left, right;
            places_below(place, node, left, right);
            bool is_left = r.lo[axis] <= plane, is_right = r.hi[axis] >= plane;
            if (is_left && is_right) waiting[count++] = right;
            place = right;
            if (is_left) place = left;
            continue;
        }
        Box part;
        if (clip_triangle(corners, state.reach, place.cell, part)) add_pair(place, j);
        if (count == 0u) return;
        place = waiting[--count];
    }
}

void main() {
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    // Of neighbouring objects: as many tiles as these primitives have.
    uint begin = first_record_of(first_tile), end = first_record_of(first_tile + chunks_of(primitive_count));
    Place root = root_place();
    for (uint j = begin + invocation_number(); j < end; j += stride) kd_find(j, root);
}
