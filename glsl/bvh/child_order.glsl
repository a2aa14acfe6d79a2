// The order of children for rays that end at their first hit: the left child of each node is the one to look into first. Children are
// swapped where the right one is. src/bvh/child_order.rs says by which rules, and records the steps; src/bvh/twin/child_order.rs is the
// twin: the same bytes.
//
//   parents  reads nodes                      writes parents; waits: 1 and how many of a node's children are inner nodes, or 0
//   climb    reads nodes, records, parents    writes nodes: children in order, and counts with them; scratch: weights, waits
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
#include "bvh/sah.glsl"

const uint NO_PARENT = 0xFFFFFFFFu;

// ChildOrder in src/bvh/child_order.rs.
layout(constant_id = 1) const uint RULE = 0;
const uint LARGER_BOX = 0;
const uint LARGER_PRIMITIVES = 1;
const uint CHEAPER = 2;
const uint MORE_HITS_FOR_ITS_COST = 3;
// Whether counts of rays say what comes first, beside that rule.
layout(constant_id = 2) const bool BY_COUNTS = false;
const float PRIOR_RAYS = 8.0;

// Squared lengths below this are those of nothing: some devices take what they are made of for zero.
const float LEAST_SQUARE = 7.888609052210118e-31;   // 2^-100

// What a ray gains in a subtree, and what that costs.
struct Weight {
    float gain;
    float cost;
};

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

// Of a normal number above 0, to the last few bits: the same bits on every device, which a division is not.
float reciprocal(float x) {
    precise float y = uintBitsToFloat(0x7EF311C3u - floatBitsToUint(x));
    y = y * (2.0 - x * y);
    y = y * (2.0 - x * y);
    y = y * (2.0 - x * y);
    return y;
}

float square_root(float x) {
    precise float h = 0.5 * x;
    precise float y = uintBitsToFloat(0x5F375A86u - (floatBitsToUint(x) >> 1));
    y = y * (1.5 - h * y * y);
    y = y * (1.5 - h * y * y);
    y = y * (1.5 - h * y * y);
    precise float root = x * y;
    return root;
}

// Of rays that meet what has the area `whole`, the part that meets what has the area `part` in it; `otherwise` where there is no area.
float share(float part, float whole, float otherwise) {
    precise float ratio = part * reciprocal(whole);
    return whole > 0.0 ? min(ratio, 1.0) : otherwise;
}

float area_of_triangle(Triangle t, float scale) {
    precise vec3 a = t.v1 * scale - t.v0 * scale;
    precise vec3 b = t.v2 * scale - t.v0 * scale;
    precise vec3 n = vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
    precise float square = n.x * n.x + n.y * n.y + n.z * n.z;
    return square >= LEAST_SQUARE ? 0.5 * square_root(square) : 0.0;
}

// The area by which a ray meets a record: a convex body is met by its half area, as a triangle by its whole. What an instance holds fills
// its leaf.
float area_of_record(uvec2 records, uint kind, uint at, float scale, float leaf_area) {
    if (kind == KIND_TRIANGLES) return area_of_triangle(Triangles(records).triangle[at], scale);
    if (kind != KIND_BOXES) return leaf_area;
    BoxRecord b = BoxRecords(records).box[at];
    return scaled_half_area(Box(b.lo, b.hi), scale);
}

Weight weight_of_leaf(Child leaf) {
    Header header = structure.header;
    uvec2 records = records_at(uvec2(structure), header.node_slots);
    uint end = leaf.index + min(leaf.count, header.active_count - min(leaf.index, header.active_count));
    float leaf_area = scaled_half_area(Box(leaf.lo, leaf.hi), header.area_scale);
    precise float area = 0.0, misses = 1.0;
    for (uint at = leaf.index; at < end; ++at) {
        float of_record = area_of_record(records, header.kind, at, header.area_scale, leaf_area);
        area = area + of_record;
        misses = misses * (1.0 - share(of_record, leaf_area, 0.0));
    }
    float count = float(leaf.count);
    precise float hits = 1.0 - misses;
    precise float cost = c_i * count;
    precise float cost_to_a_hit = cost * (1.0 - 0.5 * hits);
    if (RULE == LARGER_PRIMITIVES) return Weight(area, count);
    if (RULE == MORE_HITS_FOR_ITS_COST) return Weight(hits, cost_to_a_hit);
    return Weight(1.0, cost);
}

Weight weight_of(Child child, uint node_slots) {
    if (RULE == LARGER_BOX) {
        return Weight(scaled_half_area(Box(child.lo, child.hi), structure.header.area_scale), 1.0);
    }
    return child.count != 0u ? weight_of_leaf(child) : weights.weight[min(child.index, node_slots - 1u)];
}

// Whether the right child comes first. `shares` are of the rays in the node those that meet each child, `both` those that meet both.
bool is_right_first(Weight left, Weight right, vec2 shares, float both) {
    if (RULE == CHEAPER) {
        precise float saved = both * (left.cost - right.cost) + c_t * (shares.y - shares.x);
        return saved > 0.0;
    }
    precise float of_right = right.gain * left.cost;
    precise float of_left = left.gain * right.cost;
    return of_right > of_left;
}

// Of a node whose children come in this order.
Weight joined(Weight first, Weight second, vec2 shares, float both) {
    precise float gain = first.gain + second.gain;
    precise float cost = first.cost + second.cost;
    if (RULE == MORE_HITS_FOR_ITS_COST || RULE == CHEAPER) {
        precise float hits = shares.x * first.gain + shares.y * second.gain - both * (first.gain * second.gain);
        precise float goes_on = shares.y - both * first.gain;
        gain = RULE == CHEAPER ? 1.0 : hits;
        cost = c_t + (shares.x * first.cost + goes_on * second.cost);
    }
    return Weight(gain, cost);
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
    vec2 shares = vec2(share(scaled_half_area(Box(left.lo, left.hi), scale), area, 1.0),
                       share(scaled_half_area(Box(right.lo, right.hi), scale), area, 1.0));
    precise float both = max(shares.x + shares.y - 1.0, 0.0);
    Weight of_left = weight_of(left, node_slots), of_right = weight_of(right, node_slots);
    bool swaps = BY_COUNTS ? is_right_first(learned(2u * slot, of_left), learned(2u * slot + 1u, of_right), shares, both)
                           : is_right_first(of_left, of_right, shares, both);
    if (swaps) {
        if (BY_COUNTS) swap_counts(slot);
        structure.nodes[slot].left = right;
        structure.nodes[slot].right = left;
    }
    Weight first = of_left, second = of_right;
    if (swaps) {
        first = of_right;
        second = of_left;
        shares = shares.yx;
    }
    weights.weight[slot] = joined(first, second, shares, both);
}

void child_order_climb(uint slot, uint node_slots) {
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
