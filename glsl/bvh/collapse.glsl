// Finishing a tree whose leaves are single primitives, or pairs (bvh/pairs.glsl), at their sorted positions: subtrees become leaves where that
// is cheaper (the weights say so) or where they are as deep as tracers can walk, records go to the order of a walk, left child first.
// src/bvh/collapse.rs records the steps; src/bvh/twin/collapse.rs is the twin.
//
//   parents  reads nodes                      writes weights: parents; arrivals (zero)
//   weigh    reads nodes, parents             writes weights: counts; costs; the header's costs
//   above    reads weights                    writes the places of large nodes; of these what place writes of the others
//   place    reads weights, places, values    writes the walk's order, the nodes' children, slots that fall out, the root
//   records  reads the walk's order           writes records, or the primitives' numbers in their place
//   numbered reads those numbers              writes records, to anywhere
//   alone    all but the last, by one workgroup, for a small tree
//
// A builder that writes the weights itself needs none of the first two.
//
// Where a record goes is the sum of the counts of all left siblings on the way up. That way is long, and the larger part of it is
// that of many others too: so nodes above more than LARGE primitives go it first.
//
// needs  one barrier between each two, and before the first; subgroups of any size
#ifndef HEDGEROW_BVH_COLLAPSE
#define HEDGEROW_BVH_COLLAPSE
#include "bvh/weights.glsl"

// Primitives below a node that goes its way for others: with 16 above and place took 1.1 times as long, with 64 as long.
const uint LARGE = 32;

uint node_count() {
    return max(build_state().active_count, 1u) - 1u;
}

// ---- parents, weigh ----

Floats costs() {
    return Floats(part(parts.costs));
}

Words arrivals() {
    return Words(part(parts.arrivals));
}

void collapse_parents(uint task) {
    Structure structure = Structure(structure_address);
    Weights w = weights();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    Child root = structure.header.root;
    if (first == 0u && root.count == 0u) w.parents.word[root.index] = NO_PARENT;
    if (first == 0u && root.count != 0u) w.parents.word[parent_at(IS_PRIMITIVE)] = NO_PARENT;
    for (uint k = 0; k < ITEMS; ++k) {
        uint slot = first + k * gl_WorkGroupSize.x;
        if (slot < node_count()) {
            w.parents.word[parent_at(reference_of(structure.nodes[slot].left))] = 2u * slot;
            w.parents.word[parent_at(reference_of(structure.nodes[slot].right))] = 2u * slot + 1u;
            arrivals().word[slot] = 0;
        }
    }
}

// Count and cost of a child whose subtree is weighed.
void weight_of(Weights w, Child child, out uint count, out float cost) {
    bool is_primitive = child.count != 0u;
    count = is_primitive ? child.count : w.counts.node[child.index].all & ~IS_LEAF;
    cost = is_primitive ? leaf_cost(c_i, scaled_half_area(Box(child.lo, child.hi), build_state().plan.area_scale), child.count)
                        : costs().value[child.index];
}

void write_costs(Structure structure, float cost) {
    structure.header.cost = cost;
    structure.header.built_cost = cost;
}

// From each primitive up: of two siblings the second to arrive goes on with their parent.
void collapse_weigh(uint task) {
    Structure structure = Structure(structure_address);
    BuildState state = build_state();
    Weights w = weights();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint position = first + k * gl_WorkGroupSize.x;
        if (position >= state.active_count) break;
        uint link = w.parents.word[parent_at(position | IS_PRIMITIVE)];
        if (link == NO_PARENT) {
            Child root = structure.header.root;
            write_costs(structure, leaf_cost(c_i, scaled_half_area(Box(root.lo, root.hi), state.plan.area_scale), root.count));
        }
        // As many levels as there are nodes, at most.
        for (uint level = 0; level < node_count() && link != NO_PARENT; ++level) {
            uint slot = link >> 1;
            release_to_device();
            if (atomicAdd(arrivals().word[slot], 1u) == 0u) break;
            acquire_from_device();
            Child left = structure.nodes[slot].left, right = structure.nodes[slot].right;
            uvec2 counts;
            vec2 children_costs;
            weight_of(w, left, counts.x, children_costs.x);
            weight_of(w, right, counts.y, children_costs.y);
            float area = scaled_half_area(Box(min(left.lo, right.lo), max(left.hi, right.hi)), state.plan.area_scale);
            float cost = weigh_node(w, slot, counts, children_costs, area);
            costs().value[slot] = cost;
            link = w.parents.word[slot];
            if (link == NO_PARENT) write_costs(structure, cost);
        }
    }
}

// ---- above, place ----

// Where a subtree begins: the position of its first record and its depth; whether it is inside of a leaf.
struct Place {
    uint first;
    uint depth;
    bool inside;
};

// The places of large nodes.
Words large_firsts() {
    return Words(part(parts.large_firsts));
}

// depth * 2, + 1 inside of a leaf.
Words large_depths() {
    return Words(part(parts.large_depths));
}

// What the records will be of, by number, in the order of the walk.
Words walk_order() {
    return Words(part(parts.walk));
}

bool is_large(uint count) {
    return (count & ~IS_LEAF) > LARGE;
}

// What is deeper than tracers can walk is inside of the leaf that its ancestor becomes.
Place limited_by_depth(Place place) {
    place.inside = place.inside || place.depth > MAX_DEPTH;
    return place;
}

// Tells the parent, or the header, of what has become a leaf.
void name_leaf(uint link, uint first, uint count) {
    Words child = child_words(link);
    child.word[INDEX_WORD] = first;
    child.word[COUNT_WORD] = count;
}

// A node that falls out: its boxes stay as they are, which nobody looks at.
void mark_fallen(uint slot) {
    for (uint side = 0u; side < 2u; ++side) {
        Words child = child_words(2u * slot + side);
        child.word[INDEX_WORD] = UNUSED;
        child.word[COUNT_WORD] = UNUSED;
    }
}

// Of the nodes that an invocation has placed: how many fell out, and whether a leaf was made for the depth alone.
struct Placed {
    uint unused;
    bool limited;
};

// What becomes of a node with this count and its link to the parent.
void place_node(Structure structure, uint slot, uint count, uint link, Place place, inout Placed placed) {
    bool is_leaf = (count & IS_LEAF) != 0u;
    if (!place.inside && (is_leaf || place.depth == MAX_DEPTH)) {
        placed.limited = placed.limited || !is_leaf;
        name_leaf(link, place.first, count & ~IS_LEAF);
    }
    if (place.inside || is_leaf || place.depth == MAX_DEPTH) {
        mark_fallen(slot);
        placed.unused++;
    }
}

void write_placed(Structure structure, Placed placed) {
    uint unused = subgroupAdd(placed.unused);
    bool any_limited = subgroupOr(placed.limited ? 1u : 0u) != 0u;
    if (subgroupElect()) {
        if (unused > 0u) atomicAdd(structure.header.inner_nodes, -unused);
        if (any_limited) atomicOr(structure.header.status, STATUS_DEPTH_LIMITED);
    }
}

// The large nodes of a task, side by side in any order: few are, and lanes without one would wait for those with one.
shared uint large_count;
shared uint large_slots[ITEMS * gl_WorkGroupSize.x];

void list_large(uint task, Weights w) {
    barrier();   // behind the task before
    if (gl_LocalInvocationIndex == 0u) large_count = 0u;
    barrier();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint slot = first + k * gl_WorkGroupSize.x;
        if (slot < node_count() && is_large(w.counts.node[slot].all)) large_slots[atomicAdd(large_count, 1u)] = slot;
    }
    barrier();
}

// Large nodes go up to the root. All invocations of a workgroup come here together.
void collapse_above(uint task) {
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Placed placed = Placed(0u, false);
    list_large(task, w);
    for (uint i = gl_LocalInvocationIndex; i < large_count; i += gl_WorkGroupSize.x) {
        uint slot = large_slots[i];
        Place place = Place(0u, 0u, false);
        uint link = w.parents.word[slot];
        for (uint level = 0; level < node_count() && link != NO_PARENT; ++level) {
            uint above = link >> 1;
            NodeCounts counts = w.counts.node[above];
            if ((link & 1u) != 0u) place.first += counts.left;
            if ((counts.all & IS_LEAF) != 0u) place.inside = true;
            place.depth++;
            link = w.parents.word[above];
        }
        place = limited_by_depth(place);
        large_firsts().word[slot] = place.first;
        large_depths().word[slot] = place.depth << 1 | (place.inside ? 1u : 0u);
        place_node(structure, slot, w.counts.node[slot].all, w.parents.word[slot], place, placed);
    }
    write_placed(structure, placed);
}

// A primitive goes up to the next large node. Unless it is the first of all it is the first below the right child of one node, and
// of no other: that is the node it meets where it first comes from the right. It places that node, too, if it is not large.
void place_primitive(Structure structure, Weights w, uint position, inout Placed placed) {
    Place place = Place(0u, 0u, false), own_place = place;
    uint own = NONE, own_count = 0u, own_link = NO_PARENT, own_left = 0u;
    uint own_steps = 0u;
    uint first_link = w.parents.word[parent_at(position | IS_PRIMITIVE)];
    uint link = first_link;
    for (uint level = 0; level < node_count() && link != NO_PARENT; ++level) {
        uint slot = link >> 1;
        NodeCounts counts = w.counts.node[slot];
        bool is_right = (link & 1u) != 0u, is_leaf = (counts.all & IS_LEAF) != 0u;
        uint left = is_right ? counts.left : 0u;
        place.first += left;
        place.depth++;
        place.inside = place.inside || is_leaf;
        if (own != NONE) own_place.inside = own_place.inside || is_leaf;
        if (is_large(counts.all)) {
            uint depth = large_depths().word[slot];
            bool inside = (depth & 1u) != 0u;
            place.first += large_firsts().word[slot];
            place.depth += depth >> 1;
            place.inside = place.inside || inside;
            own_place.inside = own_place.inside || inside;
            break;
        }
        link = w.parents.word[slot];
        if (own == NONE && is_right) {
            own = slot;
            own_count = counts.all;
            own_link = link;
            own_left = left;
            own_steps = place.depth;
        }
    }
    own_place.first = place.first - own_left;
    own_place.depth = place.depth - own_steps;
    place = limited_by_depth(place);
    uint primitive = sorted_values().word[position], apart = pair_of(primitive);
    walk_order().word[place.first] = primitive;
    if (apart != 0u) walk_order().word[place.first + 1u] = primitive + apart;
    if (!place.inside) name_leaf(first_link, place.first, triangles_of_pair(apart));
    if (own != NONE) place_node(structure, own, own_count, own_link, limited_by_depth(own_place), placed);
}

void collapse_place(uint task) {
    Structure structure = Structure(structure_address);
    uint active_count = build_state().active_count, pair_count = pairs_in_all();
    Weights w = weights();
    Placed placed = Placed(0u, false);
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    if (HAS_PAIRS && first == 0u && active_count < 2u) mark_unused(structure, 0u);
    for (uint k = 0; k < ITEMS; ++k) {
        uint i = first + k * gl_WorkGroupSize.x;
        if (i < active_count) place_primitive(structure, w, i, placed);
        // Those that are left out stay behind the others.
        else if (i < primitive_count - pair_count) walk_order().word[i + pair_count] = sorted_values().word[i];
    }
    write_placed(structure, placed);
}

// ---- records ----

void collapse_records(uint task) {
    Words walk = walk_order();
    Geometry input_geometries = geometries();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint position = first + k * gl_WorkGroupSize.x;
        Box b;
        Corners c;
        if (position >= primitive_count) continue;
        uint reference = walk.word[position];
        if (HAS_NUMBERS) Words(records_of_tree()).word[position] = reference;
        else write_reference(records_of_tree(), position, input_geometries, reference, b, c);
    }
}

// Of a tree that HAS_NUMBERS: the records, to `scratch_address`.
void collapse_numbered(uint task) {
    Words numbers = Words(records_of_tree());
    Geometry input_geometries = geometries();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint position = first + k * gl_WorkGroupSize.x;
        Box b;
        Corners c;
        if (position < primitive_count) write_record(scratch_address, position, input_geometries, numbers.word[position], b, c);
    }
}
#endif
