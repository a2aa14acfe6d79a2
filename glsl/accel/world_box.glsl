// The box in the world of an instance, or of a part of one: the twin of src/accel/twin/mod.rs.
#ifndef HEDGEROW_ACCEL_WORLD_BOX
#define HEDGEROW_ACCEL_WORLD_BOX
#include "accel/parts.glsl"

// The box around a transformed box, not smaller by any rounding.
Box transformed_box(vec4 m[3], vec3 lo, vec3 hi) {
    const float SLACK = uintBitsToFloat((127u - 21u) << 23);
    Box b;
    for (uint row = 0; row < 3; ++row) {
        precise vec3 p = m[row].xyz * lo;
        precise vec3 q = m[row].xyz * hi;
        vec3 least = min(p, q), most = max(p, q), size = max(abs(p), abs(q));
        precise float slack = SLACK * (((size.x + size.y) + size.z) + abs(m[row].w));
        precise float from = (((least.x + least.y) + least.z) + m[row].w) - slack;
        precise float to = (((most.x + most.y) + most.z) + m[row].w) + slack;
        b.lo[row] = from;
        b.hi[row] = to;
    }
    return b;
}

// Whether every axis of the object stays parallel to one of the world's: then a box's image is a box.
bool keeps_boxes(vec4 m[3]) {
    bool keeps = true;
    for (uint row = 0; row < 3; ++row) {
        keeps = keeps && dot(vec3(notEqual(m[row].xyz, vec3(0.0))), vec3(1.0)) <= 1.0;
    }
    return keeps;
}

// The box in the world around the boxes of a child's two children, of nodes of two.
Box box_of_two(vec4 m[3], Structure structure, uint slots, Child child) {
    Child pair[2];
    open_node_of_two(structure, slots, child, pair);
    return united(transformed_box(m, pair[0].lo, pair[0].hi), transformed_box(m, pair[1].lo, pair[1].hi));
}

// The grid of a quantised node in the world: where it begins along each of the world's axes, below and above by what rounding may be, and
// how far along that axis a step along each of the node's own goes.
struct WorldGrid {
    vec3 below;
    vec3 above;
    vec3 step[3];
};

WorldGrid grid_in_world(vec4 m[3], QuantisedNode node) {
    // Until box_in_grid() has added all, what begins at the origin is rounded six times and what is stepped four times, each time by 2^-24 of it
    // at most, and a box reaches over at most 255 steps: 8 and 128 * 8 such parts hold that.
    const float SLACK = uintBitsToFloat((127u - 21u) << 23);
    vec3 cell = cell_of(node);
    WorldGrid grid;
    for (uint row = 0; row < 3; ++row) {
        precise vec3 from = m[row].xyz * uintBitsToFloat(node.origin);
        precise vec3 step = m[row].xyz * cell;
        vec3 size = abs(from), far = abs(step);
        precise float at = ((from.x + from.y) + from.z) + m[row].w;
        precise float slack = SLACK * ((((size.x + size.y) + size.z) + abs(m[row].w)) + 128.0 * ((far.x + far.y) + far.z));
        precise float below = at - slack;
        precise float above = at + slack;
        grid.below[row] = below;
        grid.above[row] = above;
        grid.step[row] = step;
    }
    return grid;
}

// The box in the world around one between bytes of a grid, not smaller by any rounding.
Box box_in_grid(WorldGrid grid, vec3 lo, vec3 hi) {
    Box b;
    for (uint row = 0; row < 3; ++row) {
        precise vec3 p = grid.step[row] * lo;
        precise vec3 q = grid.step[row] * hi;
        vec3 least = min(p, q), most = max(p, q);
        precise float from = ((least.x + least.y) + least.z) + grid.below[row];
        precise float to = ((most.x + most.y) + most.z) + grid.above[row];
        b.lo[row] = from;
        b.hi[row] = to;
    }
    return b;
}

// The two boxes in the world around what a part is opened to, and the area that rays need not enter any more then, for each entry more.
struct Halves {
    Box of[2];
    float saved;
};

// Around the slots that are cut off, and the others that are in use.
Halves halves_by_slots(vec4 m[3], QuantisedNode node, uint in_use, uint cut) {
    WorldGrid grid = grid_in_world(m, node);
    Box kept = empty_box(), cut_off = empty_box();
    for (uint left = in_use; left != 0u; left &= left - 1u) {
        uint slot = uint(findLSB(left));
        Box b = box_in_grid(grid, bytes_of_slot(node.lo, slot), bytes_of_slot(node.hi, slot));
        if ((cut >> slot & 1u) != 0u) cut_off = united(cut_off, b);
        else kept = united(kept, b);
    }
    precise float saved = half_area(united(kept, cut_off)) - (half_area(kept) + half_area(cut_off));
    return Halves(Box[2](kept, cut_off), saved);
}

// Of nodes of two, around the eight boxes that are three levels below. Nobody chose where these are cut, so that it may save more to open
// the halves, too: what saves most for each entry counts.
Halves halves_of_two(vec4 m[3], Structure structure, uint slots, Child part) {
    Child children[2];
    open_node_of_two(structure, slots, part, children);
    Halves halves;
    precise float area_of_halves = 0.0, area_of_quarters = 0.0;
    float added = 1.0;
    for (uint side = 0; side < 2; ++side) {
        Child below[2];
        open_node_of_two(structure, slots, children[side], below);
        Box half_box = empty_box();
        precise float quarters = 0.0;
        for (uint i = 0; i < 2; ++i) {
            Box quarter = box_of_two(m, structure, slots, below[i]);
            quarters += half_area(quarter);
            half_box = united(half_box, quarter);
        }
        float area = half_area(half_box);
        bool opens = is_node_of_two(slots, children[side]);
        area_of_halves += area;
        area_of_quarters += opens ? quarters : area;
        added += opens ? 1.0 : 0.0;
        halves.of[side] = half_box;
    }
    float area = half_area(united(halves.of[0], halves.of[1]));
    precise float once = area - area_of_halves;
    // By a constant: division may be inexact.
    precise float twice = (area - area_of_quarters) * (added == 3.0 ? 1.0 / 3.0 : added == 2.0 ? 0.5 : 1.0);
    halves.saved = max(once, twice);
    return halves;
}

// Of a part of either form; of what cannot be opened both boxes together are its own. `cut` is that of cut_of(), or 0 where only both together
// are asked for.
Halves halves_of(vec4 m[3], Structure structure, QuantisedNode node, uint slots, Child part, uint cut) {
    uint in_use = slots_of_part(node, slots, part);
    if (in_use != 0u) return halves_by_slots(m, node, in_use, cut);
    return halves_of_two(m, structure, slots, part);
}

// The box in the world of what is below `child` of a structure: where its own would be loose, around those of what it is made of.
Box world_box(vec4 m[3], Structure structure, QuantisedNode node, uint slots, Child child) {
    if (keeps_boxes(m)) return transformed_box(m, child.lo, child.hi);
    Halves halves = halves_of(m, structure, node, slots, child, 0u);
    return united(halves.of[0], halves.of[1]);
}
#endif
