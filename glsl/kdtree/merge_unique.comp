#version 460
// Leaves each of the sorted pairs once: a triangle is in several leaves of its object's tree; one workgroup. See kdtree/merge.glsl.
#include "kdtree/merge.glsl"

void main() {
    KdMerge merge = merge_state();
    Words keys = Words(merge.sorted_keys), values = Words(merge.sorted_values);
    uint words = merge.key_words, pairs = pair_count(), kept = 0;
    for (uint base = 0; base < pairs; base += gl_WorkGroupSize.x) {
        uint i = min(base + gl_LocalInvocationIndex, pairs - 1u), before = max(i, 1u) - 1u, total;
        uvec2 key = uvec2(keys.word[words * i], keys.word[words * i + words - 1u]);
        uvec2 key_before = uvec2(keys.word[words * before], keys.word[words * before + words - 1u]);
        uint value = values.word[i];
        bool is_new = base + gl_LocalInvocationIndex < pairs && (i == 0u || key != key_before);
        uint at = kept + sum_before(is_new ? 1u : 0u, total);
        barrier();
        // What is moved goes down, so what later turns read is as it was.
        if (is_new && at < i) {
            keys.word[words * at] = key.x;
            keys.word[words * at + words - 1u] = key.y;
            values.word[at] = value;
        }
        kept += total;
    }
    if (gl_LocalInvocationIndex == 0u) merge.equal_pairs = pairs - kept;
}
