// Parallel reinsertion: subtrees of a tree whose leaves have one record each move to where they cost less. src/bvh/reinsertion.rs
// describes the method and records the steps; src/bvh/twin/reinsertion.rs is the twin.
//
//   parents  reads nodes                        writes parents
//   (fill    writes gains, firsts: zero, once in ROUNDS_A_FILL rounds)
//   search   reads nodes, parents               writes moves, gains
//   match    reads parents, moves, gains        writes firsts
//   settle   reads parents, moves, firsts       writes moves: only those that are made are left
//   move     reads moves                        writes nodes, parents; the header: children have no order any more, and nothing is told of what is far
//
//   alone    all of that in all rounds, by one workgroup, for a small tree
//
// The first once, the others in each round, for every link of which offset + k · stride is one.
//
// By rays (BY_RAYS) a box costs its area and, times a ratio, the rays that meet it on a grid (bvh/flux.glsl). There are two steps behind
// the first, once, and search and move have the costs of boxes at links beside them:
//
//   (fill    writes totals: zero)
//   totals   reads nodes, grid                  adds to totals: area and rays of all nodes
//   links    reads nodes, grid, totals          writes costs; totals: the ratio, the root's cost
//
// To see what could be won and move nothing, in place of the others behind search:
//
//   gains    reads moves                        adds to sums
//
// Where a tree that is traced was changed, behind all:
//
//   depths   reads parents                      writes the header: the status, if it is deeper than tracers can walk
//
// needs  one barrier before, between each two, and after; any number of workgroups; any subgroup size
#ifndef HEDGEROW_BVH_REINSERTION
#define HEDGEROW_BVH_REINSERTION
#include "gpu/grid.glsl"
#include "bvh/layout.glsl"
#include "bvh/flux.glsl"
#include "bvh/sah.glsl"

// Whether rays say where nodes cost least, beside areas.
layout(constant_id = 3) const bool BY_RAYS = false;
// Whether a node's area is that of what it shares with a part of the scene. Or, of one that is in it and reaches beyond, the part's: all rays
// there enter it, as quantised boxes in it are coarse.
layout(constant_id = 4) const uint AREAS = 0;
const uint AREAS_WHOLE = 0;
const uint AREAS_CLIPPED = 1;
const uint AREAS_COARSE = 2;

const uint NONE = 0xFFFFFFFFu;
// In words of a node's moves a round is above those before it, in RANK_BITS: more rounds fit until they are filled with zeros.
// (ROUNDS_A_FILL in src/bvh/reinsertion.rs)
const uint RANK_BITS = 30;
const uint ROUNDS_A_FILL = 1u << 32u - RANK_BITS;
// A gain counts if it is more than this (less may be made of numbers that devices take for zero), and counts as the next at most: 2^-60,
// and the last number below 2^68. So what is left of a float has RANK_BITS.
const uint LEAST_GAIN = 67u << 23;
const uint MOST_GAIN = LEAST_GAIN + (1u << RANK_BITS) - 1u;
// Pivots of a search, at most, from the parent on: few subtrees move farther. Trees cost 1.002 of what they do without; builds take
// 0.9 of the time with one pass, and three quarters with six (docs/notes/optimisation.md).
const uint LEVELS = 10;
// Nodes that a search looks into below pivots, at most. Few look into more, and those find little there: over six scenes trees cost the same
// within 0.1% (with 64 to five digits). Where some subtrees are far larger than others, rounds would take eight times as long without it.
const uint VISITS = 32;
// Nodes that a path may have on either side: the node above the last pivot, or that of the new place, below what was looked into.
const uint PATH = max(LEVELS, VISITS) + 1;

// Of the subtree at link offset + k · stride, in the place k.
struct Move {
    uint to;       // a link; or none
    uint pivot;
    uint gain;     // the bits of a float: of positive ones, the order is the same
};

BUFFER Moves { Move move[]; };
BUFFER Part { Box box; };

layout(push_constant, scalar) uniform ReinsertionArguments {
    Structure structure;
    Words parents;      // of each slot, the link that names it
    Moves moves;
    Words gains;        // of the moves across each node, the largest gain, as a rank
    Words firsts;       // and of those with it, the smallest link, as a rank
    FluxGrid grid;
    Floats costs;       // of the boxes at links
    Words totals;       // TOTALS_…
    Words sums;         // SUMS_…
    Part part;          // of the scene, where areas are not whole
    uint offset;        // of the first round
    uint stride;
    uint since_fill;    // rounds since gains and firsts were filled
    uint rounds;        // that one workgroup does
    uint link_count;
    float by_rays;      // what rays weigh in the whole tree's cost, its area being 1
};

// Words of the totals: two sums of 64 bits, and the bits of floats.
const uint TOTALS_AREA = 0;
const uint TOTALS_RAYS = 2;
const uint TOTALS_RATIO = 4;
const uint TOTALS_ROOT = 5;      // what the root costs

// Words of what a probe finds, `Probed` in src/bvh/reinsertion.rs: 64 bits, a number, and the bits of a float.
const uint SUMS_GAINS = 0;
const uint SUMS_TRIED = 2;
const uint SUMS_ROOT_AREA = 3;

// Of the round, the link that is tried first, and what its ranks begin with.
uint first_link;
uint rank_of_round;

void begin_round(uint first, uint since) {
    first_link = first;
    rank_of_round = since << RANK_BITS;
}

uint rank_of_gain(uint gain) {
    return rank_of_round | gain - LEAST_GAIN;
}

uint rank_of_link(uint link) {
    return rank_of_round | ~link & (1u << RANK_BITS) - 1u;
}

uint link_of(uint k) {
    return first_link + k * stride;
}

// A compacted tree has fewer slots than were planned for; behind them lie records.
bool is_used(uint slot) {
    return slot < structure.header.node_slots && structure.nodes[slot].left.count != UNUSED;
}

// How many links the round tries.
uint tried() {
    return first_link < link_count ? (link_count - first_link + stride - 1) / stride : 0;
}

Child child_at(uint link) {
    if ((link & 1u) == 0u) return structure.nodes[link >> 1].left;
    return structure.nodes[link >> 1].right;
}

Box box_of(Child child) {
    return Box(child.lo, child.hi);
}

Box around(Box a, Box b) {
    return Box(min(a.lo, b.lo), max(a.hi, b.hi));
}

// What a ray weighs against area.
float ratio() {
    return BY_RAYS ? uintBitsToFloat(totals.word[TOTALS_RATIO]) : 0.0;
}

// Of a search, the part of the scene.
Box clip;

// The area of a box, as far as it counts.
float area_of(Box b, float scale) {
    if (AREAS == AREAS_WHOLE) return scaled_half_area(b, scale);
    if (AREAS == AREAS_COARSE) {
        bool is_within = all(greaterThanEqual(b.lo, clip.lo)) && all(lessThanEqual(b.hi, clip.hi));
        bool is_apart = any(greaterThan(b.lo, clip.hi)) || any(lessThan(b.hi, clip.lo));
        Box counted = Box(is_within ? b.lo : clip.lo, is_within ? b.hi : clip.hi);
        return is_apart ? 0.0 : scaled_half_area(counted, scale);
    }
    Box inside = Box(max(b.lo, clip.lo), min(b.hi, clip.hi));
    return any(lessThan(inside.hi, inside.lo)) ? 0.0 : scaled_half_area(inside, scale);
}

// Of a node with this box.
float cost_of(Box b, float scale, float of_rays) {
    float area = area_of(b, scale);
    if (!BY_RAYS) return area;
    precise float cost = area + of_rays * flux_of(grid, b);
    return cost;
}

// Of a node with the box of this child at a link.
float cost_at(uint link, Child child, float scale) {
    return BY_RAYS ? costs.value[link] : area_of(box_of(child), scale);
}

// The node above another.
uint above(uint slot) {
    return parents.word[slot] >> 1;
}

Box box_of_node(uint slot) {
    return around(box_of(structure.nodes[slot].left), box_of(structure.nodes[slot].right));
}

// A sum of 64 bits in two words.
struct Sum64 {
    uint low;
    uint high;
};

void add_to(inout Sum64 sum, uint more) {
    uint carry;
    sum.low = uaddCarry(sum.low, more, carry);
    sum.high += carry;
}

void add_to_words(Words words, uint at, Sum64 sum) {
    if ((sum.low | sum.high) == 0u) return;
    uint before = atomicAdd(words.word[at], sum.low);
    uint carry = before > 0xFFFFFFFFu - sum.low ? 1u : 0u;
    if (sum.high + carry != 0u) atomicAdd(words.word[at + 1u], sum.high + carry);
}

// The nodes that a move changes: from the parent up to the pivot, and to the node above the parent in any case; and from the new
// place up to the pivot. To be walked as
//
//     for (Path path = path_of(link, m); path.slot != NONE; advance(path)) …
struct Path {
    uint slot;
    uint top;        // where the way up from the parent ends
    uint down;       // where the other way begins; NONE on that way
    uint pivot;
    uint steps;
};

uint top_of(uint link, Move m) {
    return m.pivot == link >> 1 ? above(m.pivot) : m.pivot;
}

Path path_of(uint link, Move m) {
    return Path(link >> 1, top_of(link, m), m.to >> 1, m.pivot, 0u);
}

void advance(inout Path path) {
    // No search gives longer ones.
    if (++path.steps > 2u * PATH + 2u) {
        path.slot = NONE;
        return;
    }
    if (path.down != NONE && path.slot == path.top) {
        path.slot = path.down;
        path.down = NONE;
    } else {
        path.slot = above(path.slot);
    }
    if (path.down == NONE && path.slot == path.pivot) path.slot = NONE;
}
#endif
