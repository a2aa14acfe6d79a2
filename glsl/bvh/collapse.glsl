// Finishing a tree whose leaves are single primitives at their sorted positions: subtrees become leaves where that is cheaper
// (the weights say so) or where they are as deep as tracers can walk, records go to the order of a walk, left child first.
// src/bvh/collapse.rs records the steps; src/bvh/host/collapse.rs is the twin.
//
//   parents  reads nodes                      writes weights: parents; arrivals (zero)
//   weigh    reads nodes, parents             writes weights: counts, left_counts; costs; the header's costs
//   place    reads nodes, weights             writes the walk's order, the nodes' children, slots that fall out, the root
//   records  reads the walk's order           writes records
//
// A builder that writes the weights itself needs the last two alone.
//
// Where a record goes is the sum of the counts of all left siblings on the way up. That way is long, and few take it: the roots
// of the largest subtrees of at most TREELET primitives (and what lies above them). One invocation then walks each of them.
//
// needs  one barrier between each two, and before the first; subgroups of any size
#ifndef HEDGEROW_BVH_COLLAPSE
#define HEDGEROW_BVH_COLLAPSE
#include "bvh/weights.glsl"

layout(constant_id = 9) const uint TREELET = 16;

uint node_count() {
    return max(BuildState(state_address).active_count, 1u) - 1u;
}

// ---- parents, weigh: scratch memory behind the weights holds costs and arrivals ----

Floats costs() {
    return Floats(scratch_behind_weights());
}

Words arrivals() {
    return Words(address_of(scratch_behind_weights(), primitive_count, 4u));
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
    count = is_primitive ? 1u : w.counts.word[child.index] & ~IS_LEAF;
    cost = is_primitive ? leaf_cost(c_i, scaled_half_area(Box(child.lo, child.hi), BuildState(state_address).plan.area_scale), 1u)
                        : costs().value[child.index];
}

void write_costs(Structure structure, float cost) {
    structure.header.cost = cost;
    structure.header.built_cost = cost;
}

// From each primitive up: of two siblings the second to arrive goes on with their parent.
void collapse_weigh(uint task) {
    Structure structure = Structure(structure_address);
    BuildState state = BuildState(state_address);
    Weights w = weights();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint position = first + k * gl_WorkGroupSize.x;
        if (position >= state.active_count) break;
        uint link = w.parents.word[parent_at(position | IS_PRIMITIVE)];
        if (link == NO_PARENT) {
            Child root = structure.header.root;
            write_costs(structure, leaf_cost(c_i, scaled_half_area(Box(root.lo, root.hi), state.plan.area_scale), 1u));
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

// ---- place ----

// What a workgroup found in its tile: nodes above all treelets, the roots of treelets, primitives that are in none.
shared uint found[2u * ITEMS * gl_WorkGroupSize.x];
shared uint found_count;
// What an invocation has put off on its walk through a treelet: a reference and its depth, a level after the other.
shared uint walk_references[TREELET * gl_WorkGroupSize.x];
shared uint walk_depths[TREELET * gl_WorkGroupSize.x];

uint walk_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

bool is_large(Weights w, uint slot) {
    return (w.counts.word[slot] & ~IS_LEAF) > TREELET;
}

// The sorted positions in the order of the walk. The sort has left the memory free, and PLOC has done with it.
Words walk_order() {
    return Words(values[1u - (passes & 1u)]);
}

// Tells the parent, or the header, of what has become a leaf.
void name_leaf(uint link, uint first, uint count) {
    // In words: the root begins at 4, nodes at 32; a child has 8, its index is the fourth and its count the last.
    uint child = link == NO_PARENT ? 4u : 32u + 8u * link;
    Words words = Words(structure_address);
    words.word[child + 3u] = first;
    words.word[child + 7u] = count;
}

struct Place {
    uint first;     // position of the first record
    uint depth;
    bool inside;    // of a leaf
};

Place place_of(Weights w, uint reference) {
    Place place = Place(0, 0, false);
    uint link = w.parents.word[parent_at(reference)];
    for (uint level = 0; level < node_count() && link != NO_PARENT; ++level) {
        uint slot = link >> 1;
        if ((link & 1u) != 0u) place.first += w.left_counts.word[slot];
        if ((w.counts.word[slot] & IS_LEAF) != 0u) place.inside = true;
        place.depth++;
        link = w.parents.word[slot];
    }
    // What is deeper than tracers can walk is inside of the leaf that its ancestor becomes.
    place.inside = place.inside || place.depth > MAX_DEPTH;
    return place;
}

// Walks a treelet, or what is no larger: tells where its records go, and makes leaves. Adds what falls out to `unused`; whether a leaf
// was made for the depth alone.
bool place_treelet(Structure structure, Weights w, uint reference, Place place, inout uint unused) {
    Words order = walk_order();
    uint position = place.first;
    uint depth = place.depth;
    // Up to here everything is inside of a leaf.
    uint leaf_end = place.inside ? 0xFFFFFFFFu : 0u;
    uint level = 0;
    bool limited = false;
    for (uint visits = 0; visits < 2u * TREELET; ++visits) {
        bool inside = position < leaf_end;
        if ((reference & IS_PRIMITIVE) != 0u) {
            uint sorted = reference & ~IS_PRIMITIVE;
            order.word[position] = sorted;
            if (!inside) name_leaf(w.parents.word[parent_at(reference)], position, 1u);
            position++;
            if (level == 0u) break;
            level--;
            reference = walk_references[walk_slot(level)];
            depth = walk_depths[walk_slot(level)];
        } else {
            uint left = reference_of(structure.nodes[reference].left);
            uint right = reference_of(structure.nodes[reference].right);
            uint count = w.counts.word[reference];
            bool is_leaf = (count & IS_LEAF) != 0u;
            if (!inside && (is_leaf || depth == MAX_DEPTH)) {
                limited = limited || !is_leaf;
                count &= ~IS_LEAF;
                name_leaf(w.parents.word[reference], position, count);
                leaf_end = position + count;
                inside = true;
            }
            if (inside) {
                mark_unused(structure, reference);
                unused++;
            }
            depth++;
            walk_references[walk_slot(level)] = right;
            walk_depths[walk_slot(level)] = depth;
            level++;
            reference = left;
        }
    }
    return limited;
}

// A node above all treelets: its leaf has records that others write.
bool place_large(Structure structure, Weights w, uint slot, Place place, inout uint unused) {
    uint count = w.counts.word[slot];
    bool is_leaf = (count & IS_LEAF) != 0u;
    bool limited = !place.inside && !is_leaf && place.depth == MAX_DEPTH;
    if (!place.inside && (is_leaf || limited)) name_leaf(w.parents.word[slot], place.first, count & ~IS_LEAF);
    if (place.inside || is_leaf || limited) {
        mark_unused(structure, slot);
        unused++;
    }
    return limited;
}

void collapse_place(uint task) {
    Structure structure = Structure(structure_address);
    uint active_count = BuildState(state_address).active_count;
    Weights w = weights();
    uint nodes = node_count();
    if (gl_LocalInvocationIndex == 0u) found_count = 0;
    barrier();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint i = first + k * gl_WorkGroupSize.x;
        if (i < nodes) {
            uint link = w.parents.word[i];
            if (is_large(w, i) || link == NO_PARENT || is_large(w, link >> 1)) found[atomicAdd(found_count, 1u)] = i;
        }
        if (i < active_count) {
            uint link = w.parents.word[parent_at(i | IS_PRIMITIVE)];
            if (link == NO_PARENT || is_large(w, link >> 1)) found[atomicAdd(found_count, 1u)] = i | IS_PRIMITIVE;
        } else if (i < primitive_count) {
            // Those that are left out stay behind the others.
            walk_order().word[i] = i;
        }
    }
    barrier();
    uint unused = 0;
    bool limited = false;
    for (uint i = gl_LocalInvocationIndex; i < found_count; i += gl_WorkGroupSize.x) {
        uint reference = found[i];
        Place place = place_of(w, reference);
        bool large = (reference & IS_PRIMITIVE) == 0u && is_large(w, reference);
        bool is_limited = large ? place_large(structure, w, reference, place, unused)
                                : place_treelet(structure, w, reference, place, unused);
        limited = limited || is_limited;
    }
    unused = subgroupAdd(unused);
    bool any_limited = subgroupOr(limited ? 1u : 0u) != 0u;
    if (subgroupElect()) {
        if (unused > 0u) atomicAdd(structure.header.inner_nodes, -unused);
        if (any_limited) atomicOr(structure.header.status, STATUS_DEPTH_LIMITED);
    }
    // The next task begins with the list empty.
    barrier();
}

// ---- records ----

void collapse_records(uint task) {
    Words walk = walk_order(), sorted = Words(values[passes & 1u]);
    uvec2 records = records_at(structure_address, max(primitive_count, 2u) - 1u);
    Geometry input_geometries = geometries();
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint position = first + k * gl_WorkGroupSize.x;
        Box b;
        if (position < primitive_count) {
            write_reference(records, position, input_geometries, sorted.word[walk.word[position]], b);
        }
    }
}
#endif
