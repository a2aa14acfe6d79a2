// A tree and a copy of it that was changed: rays are traced in both, and the copy is taken where they take less work. src/trace/trial.rs
// records the steps, src/trace/twin/trial.rs is the twin: the same numbers and bytes.
//
//   (fill   writes the result: zero)
//   work    reads a tree, every `stride`-th of rays    adds to the result: their work in it
//   decide  reads both headers, the result             writes the result: whether the copy is taken
//   take    reads the result, one tree                 writes the other: header and nodes
//
// needs  one barrier before, between each two, and after; any subgroup size
#ifndef HEDGEROW_TRACE_TRIAL
#define HEDGEROW_TRACE_TRIAL
#include "gpu/grid.glsl"
#include "bvh/layout.glsl"

layout(push_constant, scalar) uniform TrialArguments {
    Structure structure;
    Structure copy;
    Words result;       // TrialResult in src/trace/trial.rs
};

// Words of the result: 64 bits for the tree's work and the copy's, and whether the copy is taken.
const uint RESULT_STRUCTURE = 0;
const uint RESULT_COPY = 2;
const uint RESULT_IS_TAKEN = 4;

// Whether two headers are of the same tree, as it was and as reinsertion has left it.
bool are_of_one(Header a, Header b) {
    return a.magic == MAGIC && b.magic == MAGIC && a.kind == b.kind && a.primitive_count == b.primitive_count &&
           a.active_count == b.active_count && a.node_slots == b.node_slots && a.inner_nodes == b.inner_nodes;
}
#endif
