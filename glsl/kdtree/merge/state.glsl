// What a merge has beside a build's state: src/kdtree/merge/mod.rs.
#ifndef HEDGEROW_KDTREE_MERGE_STATE
#define HEDGEROW_KDTREE_MERGE_STATE
#include "gpu/pass.glsl"
#include "kdtree/layout.glsl"

// A triangle of an object in a leaf of the static tree: the leaf.
struct KdPair {
    vec3 lo;
    uint node;                      // NONE of an empty leaf
    vec3 hi;
    uint depth;
};

// Where an object's own tree begins its way down the static one.
struct KdSeed {
    uvec2 tree;
    uint first_tile;                // of the object
};

// A leaf of the static tree that triangles of objects are in.
struct KdMarked {
    uint id;
    uint node;
    uint first;                     // of its pairs
    uint count;                     // references, those of the static leaf first
    uint own;                       // how many are of the static leaf
    uint from;                      // where they are
    uint begin;                     // where all are in the first level
    uint home;                      // of the leaf, or of the parent of one that is empty: where its word is to go
    uint pair;                      // of an empty leaf and its sibling: two new nodes
    uint copies;                    // whether the sibling moves as it is
};

// What a merge has overwritten.
struct KdUndone {
    uint slot;
    KdNode node;
};

BUFFER KdSeeds { KdSeed seed[]; };
BUFFER KdPairs { KdPair pair[]; };
BUFFER KdMarkedLeaves { KdMarked leaf[]; };
BUFFER KdUndo {
    KdHeader header;
    uint count;
    KdUndone undone[];
};

BUFFER KdMerge {
    // `Report` in src/kdtree/merge/estimate.rs.
    uint status;
    uint wanted_pairs;
    uint wanted_marked;
    uint wanted_references;         // of the first level
    uint level_references;          // these as a build has them
    uint level_nodes;
    uint subtree_nodes;
    uint cut_references;
    uint subtree_references;
    uint subtrees;
    uint ended;
    uint wanted_items;              // of the step that has most, or leaves in leaves
    uint items_ended;               // the step that found no room for all, and 1 more; otherwise 0
    uvec2 undo;
    uvec2 pairs;
    uvec2 keys;
    uvec2 values;
    uvec2 sorted_keys;
    uvec2 sorted_values;
    uvec2 unique_keys;              // each pair once: the memory that was sorted from, or the same where all are different already
    uvec2 unique_values;
    uvec2 pair_tiles;               // of a tile of pairs, how many count; then how many before it do
    uvec2 marked;
    uvec2 seeds;
    uvec2 items;
    uint pair_capacity;
    uint marked_capacity;
    uint record_bits;               // of a key, below those of the leaf
    uint key_words;
    uint tiles;                     // of all objects
    uint primitive_end;
    uint seed_count;
    uint item_capacity;             // of a step
    uint item_count[3];             // of a step, of the next, and of the one after, in turn
    uint met_count;                 // leaves of objects' trees in leaves of the static one
    uint unique_tiles;              // tiles that have arrived: of sorted pairs,
    uint marked_tiles;              // of pairs,
    uint described_tiles;           // and of marked leaves
    uint equal_pairs;               // of those that there is room for: what is left out, as it is there once
    uint marked_count;
    uint marked_empty;              // of them, those that get a pair
    uint marked_root;               // 1 if the tree holds nothing
    uint replaced_references;
    uint first_root;                // node
};

// In the state, behind what a build has.
const uint MERGE_AT = 3072;

// Leaves are numbered by parent and side, as those that are empty have no node; the root is 0.
const uint ROOT_ID = 0;

uint id_of(uint parent, uint side) {
    return 2u * parent + side + 1u;
}
#endif
