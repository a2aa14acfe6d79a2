// The order of children for rays that end at their first hit: the left child of each node is the one to look into first. Children are
// swapped where the right one is. src/bvh/child_order.rs says by which rules, and records the steps; src/bvh/twin/child_order.rs is the
// twin: the same bytes.
//
//   parents  reads nodes                      writes parents; waits: 1 and how many of a node's children are inner nodes, or 0
//   climb    reads nodes, records, parents    writes the header: child_order; nodes: children in order, and counts with them;
//                                             scratch: weights, waits
//
// Where boxes alone say which child comes first, climb is all, and nothing climbs.
//
// A climb begins at each node over two leaves; of two inner children the second that is done goes on with their parent. A structure
// that is larger than was planned for, or cannot be traced, is left as it is.
//
// needs  one barrier between the two, and before the first; subgroups of any size
#ifndef HEDGEROW_BVH_CHILD_ORDER
#define HEDGEROW_BVH_CHILD_ORDER
#include "gpu/pass.glsl"
#include "bvh/counts.glsl"
#include "bvh/layout.glsl"

// ChildOrder::rule in src/bvh/child_order.rs.
layout(constant_id = 1) const uint RULE = 1;
#include "bvh/child_weights.glsl"

const uint NO_PARENT = 0xFFFFFFFFu;

// Whether counts of rays say what comes first, beside that rule.
layout(constant_id = 2) const bool BY_COUNTS = false;
const float PRIOR_RAYS = 8.0;

BUFFER Weights { Weight weight[]; };

layout(push_constant, scalar) uniform ChildOrderArguments {
    Structure structure;
    Words parents;
    Words waits;
    Weights weights;
    LinkCounts counts;
    uint slots;        // at most
    uint rounds;       // slots of an invocation
    float c_t;
    float c_i;
};

// How many slots there are to look at.
uint slots_in_use() {
    Header header = structure.header;
    bool usable = header.magic == MAGIC && header.active_count != 0u && (header.status & STATUS_UNUSABLE) == 0u;
    return usable && header.root.count == 0u && header.node_slots <= slots ? header.node_slots : 0u;
}

// ---- parents ----

uint is_inner(Child child, uint node_slots) {
    return child.count == 0u && child.index < node_slots ? 1u : 0u;
}

void child_order_parents(uint slot, uint node_slots) {
    Child left = structure.nodes[slot].left, right = structure.nodes[slot].right;
    if (slot == structure.header.root.index) parents.word[slot] = NO_PARENT;
    // One more than there are, for a climb that comes by must not leave the 0 of a node over two leaves, where climbs begin.
    uint inner = is_inner(left, node_slots) + is_inner(right, node_slots);
    waits.word[slot] = left.count == UNUSED ? UNUSED : inner == 0u ? 0u : inner + 1u;
    if (left.count == UNUSED) return;
    if (is_inner(left, node_slots) != 0u) parents.word[left.index] = slot;
    if (is_inner(right, node_slots) != 0u) parents.word[right.index] = slot;
}

// ---- climb ----

// The area by which a ray meets a record: a convex body is met by its half area, as a triangle by its whole. What an instance holds fills
// its leaf.
float area_of_record(uvec2 records, uint kind, uint at, float scale, float leaf_area) {
    if (kind == KIND_TRIANGLES) {
        Triangle t = Triangles(records).triangle[at];
        return min(area_of_triangle(t.v0, t.v1, t.v2, scale), leaf_area);
    }
    if (kind != KIND_BOXES) return leaf_area;
    BoxRecord b = BoxRecords(records).box[at];
    return min(scaled_half_area(Box(b.lo, b.hi), scale), leaf_area);
}

Weight weight_of(Child child, float area, uint node_slots) {
    if (!HAS_WEIGHTS) return Weight(0.0, 0.0);
    if (child.count == 0u) return weights.weight[min(child.index, node_slots - 1u)];
    precise float area_of_primitives = 0.0;
    if (HAS_AREAS) {
        Header header = structure.header;
        uvec2 records = records_at(uvec2(structure), header.node_slots);
        uint end = child.index + min(child.count, header.active_count - min(child.index, header.active_count));
        for (uint at = child.index; at < end; ++at) {
            area_of_primitives = area_of_primitives + area_of_record(records, header.kind, at, header.area_scale, area);
        }
    }
    return weight_of_leaf(area_of_primitives, area, child.count, c_i);
}

// By rays that went into the child at a link, and by as much as PRIOR_RAYS do of what is known without them.
Weight learned(uint link, Weight without_rays) {
    LinkCount of_rays = counts.count[link];
    precise float gain = float(of_rays.hits) + PRIOR_RAYS * without_rays.gain;
    precise float cost = float(of_rays.work) + PRIOR_RAYS * without_rays.cost;
    return Weight(gain, cost);
}

void swap_counts(uint slot) {
    LinkCount left = counts.count[2u * slot];
    counts.count[2u * slot] = counts.count[2u * slot + 1u];
    counts.count[2u * slot + 1u] = left;
}

// Puts the children of a node in order, whose own are.
void order_node(uint slot, uint node_slots) {
    Child left = structure.nodes[slot].left, right = structure.nodes[slot].right;
    float scale = structure.header.area_scale;
    float area = scaled_half_area(Box(min(left.lo, right.lo), max(left.hi, right.hi)), scale);
    vec2 areas = vec2(scaled_half_area(Box(left.lo, left.hi), scale), scaled_half_area(Box(right.lo, right.hi), scale));
    Weights2 known = Weights2(weight_of(left, areas.x, node_slots), weight_of(right, areas.y, node_slots));
    Weights2 compared = known;
    if (BY_COUNTS) compared = Weights2(learned(2u * slot, known.left), learned(2u * slot + 1u, known.right));
    bool swaps;
    Weight weight = weight_in_order(known, compared, areas, area, c_t, swaps);
    if (swaps) {
        if (BY_COUNTS) swap_counts(slot);
        structure.nodes[slot].left = right;
        structure.nodes[slot].right = left;
    }
    if (HAS_WEIGHTS) weights.weight[slot] = weight;
}

void child_order_climb(uint slot, uint node_slots) {
    // Boxes are there: no node waits for another.
    if (!HAS_WEIGHTS) {
        if (structure.nodes[slot].left.count != UNUSED) order_node(slot, node_slots);
        return;
    }
    if (waits.word[slot] != 0u) return;
    // As many levels as a tree has at most.
    for (uint level = 0; level <= MAX_DEPTH; ++level) {
        order_node(slot, node_slots);
        slot = parents.word[slot];
        if (slot >= node_slots) return;
        release_to_device();
        // Another inner child is not done yet, and goes on.
        if (atomicAdd(waits.word[slot], 0xFFFFFFFFu) != 2u) return;
        acquire_from_device();
    }
}
#endif
