// The binary radix tree of sorted codes, bottom-up (Apetrei 2014): the node that splits between positions i and i + 1 has slot i,
// and the parent of the positions first..=last is that of the two neighbouring splits whose codes differ in the lower bit.
#ifndef HEDGEROW_BVH_RADIX_TREE
#define HEDGEROW_BVH_RADIX_TREE
#include "gpu/radix_sort.glsl"

// How the codes at positions i and i + 1 differ, as a number that is larger where a higher bit differs: the code's bits, then
// those of the position, which tell equal codes apart.
uvec3 difference_at(Words codes, uint i) {
    if (KEY_WORDS == 1) return uvec3(i ^ (i + 1), codes.word[i] ^ codes.word[i + 1], 0);
    return uvec3(i ^ (i + 1), codes.word[2 * i] ^ codes.word[2 * i + 2], codes.word[2 * i + 1] ^ codes.word[2 * i + 3]);
}

// Of the neighbouring splits of a subtree; at the ends of all positions there is none.
uvec3 difference_before(Words codes, uint first) {
    return first > 0 ? difference_at(codes, first - 1) : uvec3(0xFFFFFFFFu);
}

uvec3 difference_behind(Words codes, uint last, uint active_count) {
    return last + 1 < active_count ? difference_at(codes, last) : uvec3(0xFFFFFFFFu);
}

bool is_less(uvec3 a, uvec3 b) {
    if (KEY_WORDS == 2 && a.z != b.z) return a.z < b.z;
    return a.y != b.y ? a.y < b.y : a.x < b.x;
}
#endif
