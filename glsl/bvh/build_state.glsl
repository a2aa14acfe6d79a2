// What the phases of a build share: the state, the arguments, the parts of the scratch memory, and the barrier between phases of
// one workgroup.
#ifndef HEDGEROW_BVH_BUILD_STATE
#define HEDGEROW_BVH_BUILD_STATE
#include "gpu/pass.glsl"
#include "gpu/task_pool.glsl"
#include "gpu/radix_sort.glsl"
#include "bvh/layout.glsl"
#include "bvh/primitives.glsl"
#include "bvh/references.glsl"
#include "bvh/codes.glsl"

// Items of an invocation in a task; whether climbs meet in the workgroup (bvh/run.glsl) << 16.
layout(constant_id = 1) const uint ITEMS_WORD = 1;
const uint ITEMS = ITEMS_WORD & 0xFFFFu;

const uint NONE = 0xFFFFFFFFu;
const bool HAS_SECTIONS = CODE_PREFIX == PREFIX_SECTIONS;

// Where in the scratch memory each part begins, in units of 16 bytes: src/bvh/scratch.rs plans it and says when each is in use.
// The state is the first.
struct BuildParts {
    uint keys[2];              // of the sort: unsorted, and of the pass before
    uint values[2];
    uint table;
    uint ends;                 // of the radix tree's nodes: where the child that came first ends
    uint child_costs[2];       // of left and right children, in climbs of the radix tree; behind them weights (bvh/run.glsl)
    uint weights;
    uint clusters;
    uint lists[2];             // of PLOC: the clusters of even and odd rounds; of H-PLOC the first
    uint nearest;
    uint sums;                 // of tiles
    uint orders[2];            // of HLBVH: the clusters by the tasks of even and odd levels
    uint tasks;                // of HLBVH: of even and odd levels
    uint top_costs[2];         // of left and right children above treelets
    uint costs;                // of nodes that are weighed when the tree is there
    uint arrivals;
    uint large_firsts;
    uint large_depths;
    uint walk;
    uint split;                // a SplitState
    uint references;
    uint pairs;                // of triangles that are one leaf: PAIR_BLOCK a word
};

BUFFER BuildState {
    uint pool[POOL_WORDS];                // a PoolState
    uint boxes_lo[3];                     // `ordered` floats
    uint boxes_hi[3];
    uint centroids_lo[3];
    uint centroids_hi[3];
    uint active_count;
    uint status;
    uint core_lo[3];                      // of codes with sections: the boxes inside the fences
    uint core_hi[3];
    CodePlan plan;
    uint cluster_counts[2];               // of PLOC: of even and odd rounds; of HLBVH the first: treelets
    uint is_forced[2];
    uint looks;                           // clusters that rounds have looked at
    BuildParts saved_parts;               // for a kernel that does everything
    // The last three: src/bvh/encode.rs tells other passes where they are.
    Box where_most_is;                    // of codes with sections: the core, or everything where nothing is far
    uint passes_left_out;                 // of the sort, whose bits no code has
    uint pair_count;                      // keys that the sort has not: second triangles of pairs
};

// What a build is given; each kernel takes what it reads. `vertices` to `transform` with `vertex_stride` to `formats` are a
// Geometry, `column_keys` and `passes` are of the radix sort, `level` is that of the top of treelets.
#define BUILD_ARGUMENTS                                                                                        \
    uvec2 vertices; uvec2 indices; uvec2 transform; uvec2 structure_address; uvec2 scratch_address;           \
    uint vertex_stride; uint vertex_count; uint formats; uint primitive_count;                                \
    uint code_kind; uint collapses; uint build_flags;                                                         \
    float c_t; float c_i;                                                                                     \
    uint column_keys; uint passes; uint level;

#ifdef HEDGEROW_BUILD_BY_ONE_WORKGROUP
// Variables, which the shader sets first.
BUILD_ARGUMENTS
BuildParts parts;
#else
layout(push_constant, scalar) uniform BuildArguments {
    BUILD_ARGUMENTS
    BuildParts parts;
};
#endif

#ifdef HEDGEROW_BUILD_BY_ONE_DISPATCH
// A kernel that does everything would take more than push constants hold: it loads the parts out of the state, where its reset has
// put them.
BuildParts loaded_parts;
#define parts loaded_parts
#endif

BuildState build_state() {
    return BuildState(scratch_address);
}

// The address of a part.
uvec2 part(uint at) {
    return address_of(scratch_address, at, 16u);
}

// Slots of nodes that so many leaves need at most.
uint slots_of(uint leaves) {
    return max(leaves, 2u) - 1u;
}

// Slots in front of the records. Pairs have no slots but those that they need, which the plan knows; numbers in place of records lie behind
// as many as there could be, as records will lie where the nodes are.
uint slots_before_records(uint slots) {
    return HAS_PAIRS && !HAS_NUMBERS ? slots : slots_of(primitive_count);
}

// Where the records of the tree will lie.
uvec2 records_of_tree() {
    return records_at(structure_address, slots_before_records(HAS_PAIRS ? Structure(structure_address).header.node_slots : 0u));
}

// The sort's results.
Words sorted_keys() {
    return Words(part(parts.keys[passes & 1u]));
}

Words sorted_values() {
    return Words(part(parts.values[passes & 1u]));
}

Geometry geometries() {
    return Geometry(vertices, indices, transform, vertex_stride, vertex_count, formats, 0);
}

// Of pairs (bvh/pairs.glsl): triangles among which they are found, side by side in the input, and bits for each. They say how many places
// behind a triangle the other one of its pair lies; 0: it is alone; SECOND_OF_PAIR: it lies before.
const uint PAIR_BLOCK = 8;
const uint PAIR_BITS = 4;
const uint SECOND_OF_PAIR = 15;

Words blocks_of_pairs() {
    return Words(part(parts.pairs));
}

uint pair_of(uint primitive) {
    if (!HAS_PAIRS) return 0u;
    return blocks_of_pairs().word[primitive / PAIR_BLOCK] >> PAIR_BITS * (primitive % PAIR_BLOCK) & SECOND_OF_PAIR;
}

uint pairs_in_all() {
    return HAS_PAIRS ? build_state().pair_count : 0u;
}

// Triangles that a leaf of one primitive holds.
uint triangles_of_pair(uint apart) {
    return apart == 0u ? 1u : 2u;
}

// a · b / divisor, rounded down, though the product may have more than 32 bits: of numbers up to 2^24, `b` at most `divisor`.
uint scaled(uint a, uint b, uint divisor) {
    uint quotient = uint(float(a) * (float(b) / float(divisor)));
    // The estimate is off by a few, so the rest is what 32 bits of it say.
    int rest = int(a * b - quotient * divisor);
    for (uint i = 0; i < 8u && rest < 0; ++i) {
        quotient--;
        rest += int(divisor);
    }
    for (uint i = 0; i < 8u && rest >= int(divisor); ++i) {
        quotient++;
        rest -= int(divisor);
    }
    return quotient;
}

// A task for a workgroup of a dispatch over as many tiles as there may be, of which pairs leave fewer: how many, only the device knows. A CPU
// gives each core as many workgroups side by side, so those without a task (NONE) lie everywhere among the others.
uint spread_task(uint group) {
    if (!HAS_PAIRS) return group;
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint groups = (primitive_count + tile - 1u) / tile, tasks = (primitive_count - pairs_in_all() + tile - 1u) / tile;
    uint task = scaled(group, tasks, groups);
    return scaled(group + 1u, tasks, groups) > task ? task : NONE;
}

// Boxes of what leaves hold, by the first triangle, where triangles are paired. The bounds keep them where nodes will lie; the codes and the
// first clusters load them. They lie at multiples of 8, so that src/gpu/longs.rs may take two words at a time.
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer LeafBoxes { Box box[]; };

LeafBoxes leaf_boxes() {
    return LeafBoxes(records_at(structure_address, 0u));
}

// Where the box of a triangle begins that is in no leaf, or in that of another.
float nowhere() {
    return uintBitsToFloat(0x7F800000u);
}

void keep_box(uint triangle, Box b, bool is_of_leaf) {
    if (!is_of_leaf) b.lo.x = nowhere();
    leaf_boxes().box[triangle] = b;
}

// The box of what a leaf holds; returns 0, or why it is left out: a status bit or INACTIVE.
uint load_reference(Geometry g, uint reference, out Box b) {
    if (HAS_PAIRS) {
        b = leaf_boxes().box[reference];
        return b.lo.x != nowhere() ? 0u : INACTIVE;
    }
    if (!HAS_REFERENCES) return load_box(g, reference, b);
    Reference r = References(part(parts.references)).reference[reference];
    b = Box(r.lo, r.hi);
    return r.left_out;
}

// Writes the record of a leaf's primitive to its place, and outputs the leaf's box and, of a triangle, its corners. Returns as
// load_reference does.
uint write_reference(uvec2 records, uint position, Geometry g, uint reference, out Box b, out Corners c) {
    if (!HAS_REFERENCES) return write_record(records, position, g, reference, b, c);
    Reference r = References(part(parts.references)).reference[reference];
    Box whole;
    c = Corners(vec3(0), vec3(0), vec3(0));
    if (r.primitive == NO_PRIMITIVE) Triangles(records).triangle[position] = Triangle(vec3(0), vec3(0), vec3(0), NO_PRIMITIVE);
    else write_record(records, position, g, r.primitive, whole, c);
    b = Box(r.lo, r.hi);
    return r.left_out;
}

// Bits of codes, as they are given.
uint given_code_bits() {
    return code_kind >> 8 & 0x7Fu;
}

// The most bits that are taken where the primitives' spread tells how many: src/bvh/codes/spread.rs. 0 where it does not.
uint most_bits_by_spread() {
    if (!HAS_SECTIONS || (code_kind >> 23 & 1u) == 0u) return 0u;
    return min(given_code_bits() + 16u, KEY_WORDS == 1u ? 32u : 64u);
}

// Bits of codes; where the spread tells how many, from the plan on.
uint code_bits() {
    return most_bits_by_spread() != 0u ? build_state().plan.bits : given_code_bits();
}

// The sort's first passes that are left out: those that codes have no bits for.
uint passes_left_out() {
    return most_bits_by_spread() != 0u ? build_state().passes_left_out : 0u;
}

CodeKind kind_of_codes() {
    return CodeKind(code_kind & 3u, code_bits(), 3u * (code_kind >> 6 & 3u), code_kind >> 2 & 3u,
                    (code_kind >> 4 & 3u) + (CODE_PREFIX == PREFIX_CELLS ? 1u : 0u), code_kind >> 15 & 0xFu, 1u << (code_kind >> 19 & 0xFu));
}

// Of codes with sections: whether what is far stands right below the root (CodeBounds::Apart in src/bvh/codes/bounds.rs).
bool far_is_apart() {
    return (code_kind >> 24 & 1u) != 0u;
}

Box bounds_of_boxes(BuildState state) {
    return Box(from_ordered(uvec3(state.boxes_lo[0], state.boxes_lo[1], state.boxes_lo[2])),
               from_ordered(uvec3(state.boxes_hi[0], state.boxes_hi[1], state.boxes_hi[2])));
}
#endif
