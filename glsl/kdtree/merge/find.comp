#version 460
// The leaves of the static tree that triangles of objects without trees are in; workgroups share the triangles. See
// kdtree/merge.glsl.
//
// Boxes are walked down, and what is left of the triangle in the leaf's cell decides, so that the leaves do not depend on the way.
#include "kdtree/merge.glsl"

// The way down to a node, a level each: the node above, whether the way goes to its left child, and whether its right child waits.
// The cell is cut on the way down and made whole on the way up by the bound that was cut.
uint way[KD_MAX_DEPTH + 1];
float cut_bound[KD_MAX_DEPTH + 1];
const uint GOES_LEFT = 1;
const uint RIGHT_WAITS = 2;

// Down from an inner node to a child.
Place go_down(Place place, KdNode node, bool to_left, bool right_waits) {
    uint axis = node.second & 3u;
    way[place.depth] = place.node << 2 | (to_left ? GOES_LEFT : 0u) | (right_waits ? RIGHT_WAITS : 0u);
    cut_bound[place.depth] = to_left ? place.cell.hi[axis] : place.cell.lo[axis];
    Place left, right;
    places_below(place, node, left, right);
    place = right;
    if (to_left) place = left;
    return place;
}

// Up to the lowest node whose right child waits; false if none does.
bool go_up(inout Place place) {
    KdStructure structure = KdStructure(structure_address);
    for (uint turn = 0; turn <= KD_MAX_DEPTH && place.depth > 0u; ++turn) {
        place.depth -= 1u;
        uint step = way[place.depth];
        place.node = step >> 2;
        uint axis = structure.nodes[place.node].second & 3u;
        if ((step & GOES_LEFT) != 0u) place.cell.hi[axis] = cut_bound[place.depth];
        else place.cell.lo[axis] = cut_bound[place.depth];
        if ((step & RIGHT_WAITS) != 0u) return true;
    }
    return false;
}

void kd_find(uint j, Place root) {
    KdState state = build_state();
    KdReference r = references_of(0u).reference[j];
    Corners corners = corners_of_record(r.record);
    Place place = root;
    // Each turn is a node or an empty leaf.
    uint turns = 2u * KdStructure(structure_address).header.node_count + 1u;
    for (uint turn = 0; turn < turns; ++turn) {
        KdNode node = node_of(place);
        if (!kd_is_leaf(node)) {
            uint axis = node.second & 3u;
            float plane = uintBitsToFloat(node.first);
            bool is_left = r.lo[axis] <= plane, is_right = r.hi[axis] >= plane;
            place = go_down(place, node, is_left, is_left && is_right);
        } else {
            Box part;
            if (clip_triangle(corners, state.reach, place.cell, part)) add_pair(place, j);
            if (!go_up(place)) return;
            place = go_down(place, node_of(place), false, false);
        }
    }
}

void main() {
    uint stride = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    // Of neighbouring objects: as many tiles as these primitives have.
    uint begin = first_record_of(first_tile), end = first_record_of(first_tile + chunks_of(primitive_count));
    Place root = root_place();
    for (uint j = begin + invocation_number(); j < end; j += stride) kd_find(j, root);
}
