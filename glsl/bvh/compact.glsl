// Compacts a Bvh2: the same tree depth first, left child first, without unused slots and without the records that are in no
// leaf. src/bvh/compact.rs records the five steps, src/bvh/twin/compact.rs is the twin.
//
//   parents  reads the source                   writes places
//   sizes    reads and writes places
//   indices  reads and writes places, those of large subtrees
//   nodes    reads the source and places        writes the target's header and nodes
//   records  reads the source                   writes the target's records, over the places, and what lies behind them
//
// A node's index in the target is the way to it from the root: a left child is one behind its parent, a right child one and
// the left one's subtree. Climbing to the root from each node took most of the time, so it is done for the roots of large
// subtrees, and the others climb to the next of those.
//
// Nobody gives this pass scratch memory, so a place of four words for each old slot lies where the records will be: nodes of a
// tree of n records are in the slots below n - 1, and a record has seven words or more.
//
// A tree of quantised nodes has no holes: it is copied. Anything that is not a structure becomes an empty one with the status WRONG_VERSION; one that cannot be traced becomes an empty one with
// its own status.
//
// needs  one barrier before, between each two, and after; any number of workgroups; any subgroup size; no overlap of the two
#ifndef HEDGEROW_BVH_COMPACT
#define HEDGEROW_BVH_COMPACT
#include "bvh/copy.glsl"

// What is known of a slot.
struct Place {
    uint up;         // where the node's parent is << 2, with the bits below
    uint left;       // nodes of the left child's subtree, if the right child is a node
    uint size;       // nodes of its subtree; before, of the child's that is done first; INDEX | the node's index
    uint is_lowest;  // whether it has a node of two leaves
};

const uint IS_RIGHT = 1;       // the node is a right child
const uint HAS_SIBLING = 2;    // its sibling is a node, too
const uint INDEX = 0x80000000u;
// Nodes of a subtree whose root climbs to that of the tree.
const uint LARGE = 32;

BUFFER Places { Place place[]; };

layout(push_constant, scalar) uniform CompactArguments {
    Structure source;
    Structure target;
};

// How many slots may hold a node.
uint slots_to_see(Header header) {
    Header becomes = compacted(header);
    return is_binary(header) && becomes.inner_nodes != 0 ? min(header.node_slots, becomes.active_count - 1) : 0;
}

Places places_of(Header header) {
    return Places(records_at(uvec2(target), compacted(header).node_slots));
}

bool is_node(Child child) {
    return child.count == 0;
}

// From a node to its parent; how far it is behind it.
uint climb(Places places, inout uint slot) {
    uint up = places.place[slot].up;
    slot = up >> 2;
    return 1 + ((up & IS_RIGHT) != 0u ? places.place[slot].left : 0);
}
#endif
