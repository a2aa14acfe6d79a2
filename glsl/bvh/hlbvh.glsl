// HLBVH (Pantaleoni and Luebke 2010): treelets of the radix tree, and over them a top that the surface area heuristic splits, by
// a queue of tasks (Garanzha, Pantaleoni, McAllister 2011). src/bvh/hlbvh.rs records it; src/bvh/twin/hlbvh.rs is the twin and
// says what the papers leave open.
//
//   treelets  reads the primitives, keys, values    writes nodes and weights inside treelets; ends: which splits are inside
//   count     reads ends                            writes sums: treelets of each tile          (bvh/hlbvh/treelets.glsl)
//   scan      reads sums                            writes sums (exclusive), the number of treelets, the first task
//   gather    reads ends, nodes, weights, sums      writes clusters: a treelet each; order 0
//   split     reads clusters, order, tasks          writes nodes, parents, the next level's order and tasks; a level at a time
//   finish    the same, all levels that are left of each task                                   (bvh/hlbvh/split.glsl)
//   weigh     reads nodes, parents, clusters        writes weights and costs above treelets
//   (collapse: bvh/collapse.glsl)
//
// How many tasks a level has stands where the pool looks for it, in a chain of dispatches too.
//
// needs one barrier between each two, and before the first; subgroups of any size; workgroups of whole subgroups or less than one
#ifndef HEDGEROW_BVH_HLBVH
#define HEDGEROW_BVH_HLBVH
#include "bvh/clusters.glsl"
#include "bvh/tiles.glsl"

// Primitives of a treelet at most.
layout(constant_id = 7) const uint TREELET_PRIMITIVES = 16;
// Bits of the code that a treelet's primitives share; BY_COUNT takes as many as number all primitives.
layout(constant_id = 8) const uint TREELET_BITS = 0xFFFFFFFFu;
const uint BY_COUNT = 0xFFFFFFFFu;
// Levels of the top that have phases, at most.
const uint LEVELS = 32;

uint treelet_bits() {
    uint numbering = uint(findMSB(max(primitive_count, 2u) - 1u)) + 1u;
    return min(TREELET_BITS == BY_COUNT ? numbering : TREELET_BITS, kind_of_codes().bits);
}

// Phases behind the sort.
const uint PHASE_TREELETS = 0;
const uint PHASE_COUNT = 1;
const uint PHASE_SCAN = 2;
const uint PHASE_GATHER = 3;
const uint PHASE_SPLIT = 4;
const uint PHASE_FINISH = PHASE_SPLIT + LEVELS;
const uint PHASE_WEIGH = PHASE_FINISH + 1;
const uint PHASE_ABOVE = PHASE_FINISH + 2;
const uint PHASE_PLACE = PHASE_FINISH + 3;
const uint PHASES_BEHIND_SORT = PHASE_FINISH + 5;

uint treelet_count() {
    return build_state().cluster_counts[0];
}

// The clusters in the order of a level: neighbours are of one task.
Words order_of(uint level) {
    return Words(part(parts.orders[level & 1u]));
}

// A range of a level's order that is split in two, and what names its node. It has two clusters at least.
struct Task {
    uint begin;
    uint end;
    uint link;
};

BUFFER Tasks { Task task[]; };

Tasks all_tasks() {
    return Tasks(part(parts.tasks));
}

// Where the tasks of a level begin: those of even and odd levels have room side by side.
uint first_task(uint level) {
    return (level & 1u) * (primitive_count / 2u);
}

// Where the number of tasks of a phase behind the sort stands.
uint pool_phase(uint phase) {
    return phases_before_hierarchy() + phase;
}

uint task_count(uint level) {
    return PoolState(scratch_address).tasks[pool_phase(PHASE_SPLIT + level)];
}

// ---- weigh ----

// Primitives below a child.
uint count_of(Weights w, Child child) {
    return child.count != 0u ? 1u : w.counts.node[child.index].all & ~IS_LEAF;
}

float top_cost(uint slot, uint side) {
    return Floats(part(parts.top_costs[side])).value[slot];
}

// From each treelet up: of two siblings the second to arrive goes on with their parent, whose count holds until then which has arrived.
void hlbvh_weigh(uint task) {
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Clusters clusters = all_clusters();
    float area_scale = build_state().plan.area_scale;
    uint count = treelet_count();
    uint first = task * tile_size() + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint i = first + k * gl_WorkGroupSize.x;
        if (i >= count) break;
        uint link = w.parents.word[parent_at(clusters.cluster[i].reference)];
        float cost = clusters.cluster[i].cost;
        // As many levels as there are nodes, at most.
        for (uint level = 0; level < count && link != NO_PARENT; ++level) {
            uint slot = link >> 1;
            Floats(part(parts.top_costs[link & 1u])).value[slot] = cost;
            release_to_device();
            if (atomicAdd(w.counts.node[slot].all, 1u) == 0u) break;
            acquire_from_device();
            Child left = structure.nodes[slot].left, right = structure.nodes[slot].right;
            vec2 costs = vec2(top_cost(slot, 0u), top_cost(slot, 1u));
            float area = scaled_half_area(Box(min(left.lo, right.lo), max(left.hi, right.hi)), area_scale);
            cost = weigh_node(w, slot, uvec2(count_of(w, left), count_of(w, right)), costs, area);
            link = w.parents.word[slot];
            if (link == NO_PARENT) {
                structure.header.cost = cost;
                structure.header.built_cost = cost;
            }
        }
    }
}
#endif
