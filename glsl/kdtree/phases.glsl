// A task of a phase by its number: what the chain of dispatches and the pool have in common.
#ifndef HEDGEROW_KDTREE_PHASES
#define HEDGEROW_KDTREE_PHASES
#include "kdtree/encode.glsl"
#include "kdtree/small.glsl"
#include "kdtree/distribute.glsl"
#include "kdtree/place.glsl"

void kd_bin(uint item, uint of_level) {
    uint chunks = build_state().binned_chunks[of_level];
    if (item < chunks) kd_bin_chunk(item, of_level);
    else kd_small(build_state().first_subtree[of_level] + item - chunks, of_level);
}

// The last chunk of a level scans it; of a level without chunks somebody must.
void kd_classify(uint chunk, uint of_level) {
    if (build_state().chunk_count[of_level] > 0u) {
        kd_classify_chunk(chunk, of_level);
        if (!kd_sum_chunk(chunk, of_level)) return;
    }
    kd_scan(of_level);
}

// A task of the pool, of a phase of the levels.
void kd_level(uint phase, uint item) {
    uint of_level = (phase - PHASE_LEVELS) / 3u, of_three = (phase - PHASE_LEVELS) % 3u;
    if (of_three == 0u) kd_bin(item, of_level);
    else if (of_three == 1u) kd_classify(item, of_level);
    else kd_distribute(item, of_level);
}
#endif
