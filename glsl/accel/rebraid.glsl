// Re-braiding (Benthin, Woop, Wald 2017): before a top level is built, entries whose boxes are loose are opened, each replaced
// by the two children of the node that it begins at, while the budget lasts. src/accel/rebraid.rs records the rounds.
//
//   weigh   reads entries, the structures below     writes gains of entries that have none yet; histogram[round]
//   select  reads gains, histogram[round]           writes sums[chunk]: entries that the round opens
//   open    reads all of them                       writes entries, gains, count[round + 1]
//
// What a round may spend is its share of what is left, so that the loosest entries are opened deeper than others are at all.
// Entries are opened in the order of their gain, by 512 classes of it, within a class in that of their index: nothing depends
// on who comes first.
//
// needs one barrier between each two; any subgroup size; `chunks` workgroups
#ifndef HEDGEROW_ACCEL_REBRAID
#define HEDGEROW_ACCEL_REBRAID
#include "accel/world_box.glsl"

const uint CLASSES = 512;
const uint ROUNDS = 8;
const uint CHUNKS_AT_MOST = 256;
// Of a gain: not weighed yet; weighed, and nothing is gained. All begins as zeros.
const float UNKNOWN = 0.0;
const float NO_GAIN = -1.0;

BUFFER RebraidState {
    uint count[ROUNDS + 1];   // the first is not read
    uint histogram[ROUNDS * CLASSES];
    // What is opened for sure, and what is in the class of which some are.
    uint sums[2 * CHUNKS_AT_MOST];
};

layout(push_constant, scalar) uniform Arguments {
    Entries entries;
    Floats gains;
    RebraidState state;
    uint capacity;
    uint round;
    uint chunks;
    float tolerance;   // of the children's area, over that of their parent
    uint instance_count;
};

uint count_of_entries() {
    return round == 0u ? instance_count : state.count[round];
}

uint class_of(float gain) {
    return floatBitsToUint(gain) >> 22 & (CLASSES - 1u);
}

// What a round opens: all of the classes above `partial`, and of that class the first `quota`.
struct Selection {
    uint partial;
    uint quota;
};

Selection selection_of_round() {
    uint left = capacity - min(count_of_entries(), capacity);
    uint share = (left + (ROUNDS - round) - 1u) / (ROUNDS - round);
    for (uint i = 0; i < CLASSES; ++i) {
        uint bucket = CLASSES - 1u - i;
        uint there = state.histogram[round * CLASSES + bucket];
        if (there > share) return Selection(bucket, share);
        share -= there;
    }
    return Selection(0u, 0u);
}

// The entries of a chunk.
uvec2 range_of_chunk(uint chunk) {
    uint count = count_of_entries();
    uint size = (count + chunks - 1u) / chunks;
    return uvec2(min(chunk * size, count), min((chunk + 1u) * size, count));
}

// x: opened for sure; y: in the class of which some are.
uvec2 kind_of(float gain, Selection s) {
    if (!(gain > 0.0)) return uvec2(0);
    uint bucket = class_of(gain);
    return uvec2(bucket > s.partial ? 1u : 0u, bucket == s.partial ? 1u : 0u);
}
#endif
