// Collapses a Bvh2 into a wide tree: src/bvh/wide/device.rs records the steps, src/bvh/twin/wide.rs is the twin.
//
//   (choices)        bvh/wide/costs.glsl: which binary nodes a wide one takes in
//   (cleared)        blocks
//   open_few         reads the source, choices, opened of a level writes slots, opened of the next level, levels, choices: how many nodes
//                                                                 each names, units, blocks; of the first level also that
//   open             the same of one level
//   pair             reads the source, opened, slots             writes partners, units, blocks: of quantised trees of triangles
//   (scan)           the sums of blocks: exclusive ones over all blocks before
//   nodes            reads the source and all that               writes the target's header and nodes, places
//   records          reads the source, places, partners          writes the target's records and table of geometries
//   alone            all of that, by one workgroup, for a small tree
//
// Which binary nodes wide ones begin with is found from the root down, a level of wide nodes after the other. The list of a
// level is in whatever order the atomics gave; nothing of it reaches the target: a node's index is one and the number of nodes
// that are named by nodes of lower slots, and its rank among the nodes of its parent; the sums make them, over blocks of slots, of which few
// are of wide nodes. So nodes that one names lie side by side, as do, of quantised nodes, the records of its leaves.
//
// The children of a wide node lie in their slots as a walk meets them that takes left ones first. Those of quantised nodes lie by octants,
// unless the source's have an order (bvh/child_order.glsl): then the target's header says so, too, and rays that were counted may choose it.
//
// Anything that is not a structure becomes an empty one with the status WRONG_VERSION; one that cannot be traced becomes an empty one with
// its own status.
//
// Records of quantised nodes lie in units: of triangles 8 bytes each (bvh/wide/pairs.glsl), otherwise a record each.
//
// needs  one barrier before, between each two, and after; any number of workgroups, but one for open_few and alone; any subgroup
//        size; no overlap of source, target and scratch
#ifndef HEDGEROW_BVH_WIDE_COLLAPSE
#define HEDGEROW_BVH_WIDE_COLLAPSE
#include "bvh/copy.glsl"
#include "bvh/counts.glsl"
#include "bvh/sah.glsl"
#include "bvh/wide.glsl"
#include "bvh/wide/pairs.glsl"
#extension GL_EXT_control_flow_attributes : require

layout(constant_id = 2) const uint WIDTH = 4;
layout(constant_id = 3) const bool QUANTISED = false;
// Whether children in order are those first that end more rays for their work.
layout(constant_id = 4) const bool BY_HITS = false;

// src/bvh/wide/mod.rs
const uint LEVELS_BY_COST = 24;
const float PRIOR_WORK = 24.0;
const uint LEVELS_AT_MOST = 64;
// Leaves of more triangles are nodes of their own: a byte holds the units of others, if none are pairs.
const uint LEAF_MAX_TRIANGLES = LEAF_MAX / UNITS_OF_ONE;
// In place of a partner: alone, or the second of a pair. Otherwise how many records behind it the second lies, and above 4 bits
// which of the four vertices are its own, two bits each.
const uint ALONE = 0;
const uint IS_SECOND = 0xFFFFFFFFu;
// What names a child, which is where it lies among all children of the source: twice its node's slot, of which there are fewer than 2^27, and
// one for the right one. A slot of a wide node has above it what the child is, so that it need not be loaded to tell.
const uint NAME_BITS = 28;
const uint NAME = (1u << NAME_BITS) - 1u;
const uint SHORT_LEAF = 1u << NAME_BITS;
const uint LONG_LEAF_NODE = 2u << NAME_BITS;
// In place of a name: the root of a tree that is a leaf; in place of all of it: nothing.
const uint WHOLE_TREE = NAME;
const uint NO_CHILD = 0xFFFFFFFFu;

// A wide node to be: the slot of the binary node that it begins with; that of its parent << 3 | which of its nodes it is.
struct Opened {
    uint slot;
    uint place;
};

BUFFER Levels {
    uint count[LEVELS_AT_MOST];
    uint first[LEVELS_AT_MOST + 1];   // of opened: where a level begins
    uint end;                         // of all levels that have a node
};
BUFFER OpenedNodes { Opened node[]; };
// Of the source's slots, in blocks of SLOTS_OF_BLOCK: which ones wide nodes begin with, a bit each, of every block; then how many nodes those
// name, and of quantised nodes how many units of records they have, of every block and one more.
const uint SLOTS_OF_BLOCK = 16;   // src/bvh/wide/device.rs

// Multiples of 8, so that src/gpu/longs.rs may take two words at a time.
layout(buffer_reference, scalar, buffer_reference_align = 8) nonprivate buffer Quads { uvec4 of[]; };

layout(push_constant, scalar) uniform WideCollapseArguments {
    Structure source;
    uvec2 target;
    Levels levels;
    OpenedNodes opened;
    Words starts;            // see bvh/wide/costs.glsl
    Quads costs;
    Words choices;           // of each of the source's slots: what was chosen, and since it is opened, how many nodes it names
    LinkCounts visits;       // of the source's links, by visits
    LinkCounts hits;         // and by hits
    Quads slots;             // what each of opened has in its slots, WIDTH words
    Words blocks;            // see SLOTS_OF_BLOCK
    Words units;             // of quantised nodes: of each of the source's slots that is opened, units of its records
    Words places;            // of quantised nodes: in which of the target's units each of the source's records lies
    Words partners;          // of each of the source's records, if it is a triangle: see pair.comp
    uvec2 given_records;     // the source's, which has the numbers of its primitives in their place; 0: they are there
    uint source_slots;       // at most
    uint capacity;           // of opened
    uint level;
    uint level_end;
};

bool can_be_collapsed(Header header) {
    return is_binary(header) && holds_something(header);
}

bool has_numbers() {
    return any(notEqual(given_records, uvec2(0)));
}

uvec2 source_records() {
    return has_numbers() ? given_records : records_at(uvec2(source), source.header.node_slots);
}

uvec2 source_table() {
    if (!has_numbers()) return geometry_table_of(uvec2(source), source.header);
    return address_of(records_at(uvec2(source), source_slots), source.header.primitive_count, 4u);
}

bool is_inner(Child child) {
    return child.count == 0;
}

// Whether two triangles may be one record.
bool is_paired() {
    return QUANTISED && source.header.kind == KIND_TRIANGLES;
}

// Whether a leaf is a node of its own.
bool is_long(uint count) {
    return QUANTISED && count > (is_paired() ? LEAF_MAX_TRIANGLES : LEAF_MAX);
}

// What is in the slots of a wide node that are not looked at yet, the next one first.
struct NextSlots {
    uvec4 next;
    uvec4 behind;
};

NextSlots slots_of(uint at) {
    uint quads = WIDTH / 4u;
    return NextSlots(slots.of[at * quads], WIDTH == 8u ? slots.of[at * quads + 1u] : uvec4(NO_CHILD));
}

uint take_slot(inout NextSlots all) {
    uint slot = all.next.x;
    all.next = uvec4(all.next.yzw, all.behind.x);
    all.behind = uvec4(all.behind.yzw, NO_CHILD);
    return slot;
}

uint word_of_slot(uint at, uint s) {
    return Words(uvec2(slots)).word[at * WIDTH + s];
}

bool is_leaf_in(uint slot) {
    return slot > NAME && slot != NO_CHILD;
}

bool is_long_leaf_in(uint slot) {
    return slot >= LONG_LEAF_NODE && slot != NO_CHILD;
}

// Whether it holds a node of the wide tree: an inner child, or a leaf that is too long.
bool is_node_in(uint slot) {
    return slot <= NAME || is_long_leaf_in(slot);
}

uint units_by_partner(uint partner) {
    return partner == IS_SECOND ? 0 : partner == ALONE ? UNITS_OF_ONE : UNITS_OF_TWO;
}

// Behind the last record of a leaf.
uint end_of_leaf(Child leaf) {
    return min(leaf.index + leaf.count, source.header.primitive_count);
}

// Units that the leaf's records take.
uint units_of_leaf(Child leaf) {
    if (!is_paired()) return leaf.count;
    uint units = 0, end = end_of_leaf(leaf);
    for (uint r = leaf.index; r < end; ++r) units += units_by_partner(partners.word[r]);
    return units;
}

Child child_named(uint name) {
    if (name == WHOLE_TREE) return source.header.root;
    return Children(uvec2(source)).child[HEADER_CHILDREN + name];
}

Child child_in(uint slot) {
    return child_named(slot & NAME);
}

// The box of the binary node that a wide one begins with, which is that of the wide one. Of a tree that is a leaf it is the leaf's.
Box box_of_node(uint slot) {
    Child root = source.header.root;
    if (!is_inner(root)) return Box(root.lo, root.hi);
    Child left = child_named(2 * slot), right = child_named(2 * slot + 1);
    return Box(min(left.lo, right.lo), max(left.hi, right.hi));
}

uint block_count() {
    return (source_slots + SLOTS_OF_BLOCK - 1u) / SLOTS_OF_BLOCK;
}

uint block_of(uint slot) {
    return slot / SLOTS_OF_BLOCK;
}

uint bit_in_block(uint slot) {
    return 1u << slot % SLOTS_OF_BLOCK;
}

// Where the nodes that wide nodes of a block name are summed up, and the units of their records.
uint nodes_of_block(uint block) {
    return block_count() + block;
}

uint units_of_block(uint block) {
    return 2u * block_count() + 1u + block;
}

uint block_words() {
    return (QUANTISED ? 3u : 2u) * block_count() + (QUANTISED ? 2u : 1u);
}

// Notes how many units of records the wide node has that begins with a slot.
void note_units(uint slot, uint count) {
    units.word[slot] = count;
    atomicAdd(blocks.word[units_of_block(block_of(slot))], count);
}

// Which of opened are of a level: the first, and how many.
uvec2 opened_of(uint level) {
    uint first = min(levels.first[level], capacity);
    return uvec2(first, min(levels.count[level], capacity - first));
}

// The next level begins where this one ends: one invocation of those that open it notes it.
void note_end(uint level, uint end) {
    levels.first[level + 1] = end;
    levels.end = end;
}
#endif
