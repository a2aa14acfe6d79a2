// What children are ordered by for rays that end at their first hit, whoever makes the tree: src/bvh/child_order.rs has the rules, and
// `Ordering` in src/bvh/twin/child_order.rs is the twin, bit for bit.
//
// Includers define RULE, a constant or specialisation constant, before: AS_BUILT or one of the others.
#ifndef HEDGEROW_BVH_CHILD_WEIGHTS
#define HEDGEROW_BVH_CHILD_WEIGHTS
#include "bvh/sah.glsl"

const uint AS_BUILT = 0;
// ChildOrder::rule in src/bvh/child_order.rs.
const uint LARGER_BOX = 1;
const uint LARGER_PRIMITIVES = 2;
const uint CHEAPER = 3;
const uint MORE_HITS_FOR_ITS_COST = 4;

// Whether a rule looks at what is below a child, and whether at the areas of primitives.
const bool HAS_WEIGHTS = RULE > LARGER_BOX;
const bool HAS_AREAS = RULE == LARGER_PRIMITIVES || RULE == MORE_HITS_FOR_ITS_COST;

// Squared lengths below this are those of nothing: some devices take what they are made of for zero.
const float LEAST_SQUARE = 7.888609052210118e-31;   // 2^-100

// What a ray gains in a subtree, and what that costs.
struct Weight {
    float gain;
    float cost;
};

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

float area_of_triangle(vec3 v0, vec3 v1, vec3 v2, float scale) {
    precise vec3 a = v1 * scale - v0 * scale;
    precise vec3 b = v2 * scale - v0 * scale;
    precise vec3 n = vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
    precise float square = n.x * n.x + n.y * n.y + n.z * n.z;
    return square >= LEAST_SQUARE ? 0.5 * square_root(square) : 0.0;
}

Weight weight_of_leaf(float area_of_primitives, float leaf_area, uint count, float test_cost) {
    precise float cost = test_cost * float(count);
    precise float hits = share(area_of_primitives, leaf_area, 0.0);
    precise float cost_to_a_hit = cost * (1.0 - 0.5 * hits);
    if (RULE == LARGER_PRIMITIVES) return Weight(area_of_primitives, float(count));
    if (RULE == MORE_HITS_FOR_ITS_COST) return Weight(hits, cost_to_a_hit);
    return Weight(1.0, cost);
}

// Whether the right child comes first. `shares` are of the rays in the node those that meet each child, `both` those that meet both.
bool is_right_first(Weight left, Weight right, vec2 shares, float both, float step_cost) {
    if (RULE == LARGER_BOX) return shares.y > shares.x;
    if (RULE == CHEAPER) {
        precise float saved = both * (left.cost - right.cost) + step_cost * (shares.y - shares.x);
        return saved > 0.0;
    }
    precise float of_right = right.gain * left.cost;
    precise float of_left = left.gain * right.cost;
    return of_right > of_left;
}

// Of a node whose children come in this order.
Weight joined(Weight first, Weight second, vec2 shares, float both, float step_cost) {
    precise float gain = first.gain + second.gain;
    precise float cost = first.cost + second.cost;
    if (RULE == MORE_HITS_FOR_ITS_COST || RULE == CHEAPER) {
        precise float hits = shares.x * first.gain + shares.y * second.gain - both * (first.gain * second.gain);
        precise float goes_on = shares.y - both * first.gain;
        gain = RULE == CHEAPER ? 1.0 : hits;
        cost = step_cost + (shares.x * first.cost + goes_on * second.cost);
    }
    return Weight(gain, cost);
}

// Of both children of a node.
struct Weights2 {
    Weight left;
    Weight right;
};

// Of a node of two children, their boxes having these areas and the one around both `area`: its weight, and whether they swap places by
// what they are compared by.
Weight weight_in_order(Weights2 w, Weights2 compared, vec2 areas, float area, float step_cost, out bool swaps) {
    vec2 shares = RULE == LARGER_BOX ? areas : vec2(share(areas.x, area, 1.0), share(areas.y, area, 1.0));
    precise float both = max(shares.x + shares.y - 1.0, 0.0);
    swaps = is_right_first(compared.left, compared.right, shares, both, step_cost);
    if (swaps) return joined(w.right, w.left, shares.yx, both, step_cost);
    return joined(w.left, w.right, shares, both, step_cost);
}
#endif
