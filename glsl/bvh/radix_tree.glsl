// The binary radix tree of sorted codes, bottom-up (Apetrei 2014): the node that splits between positions i and i + 1 has slot i,
// and the parent of the positions first..=last is that of the two neighbouring splits whose codes differ in the lower bit.
#ifndef HEDGEROW_BVH_RADIX_TREE
#define HEDGEROW_BVH_RADIX_TREE
#include "gpu/radix_sort.glsl"

// How the codes at two positions differ, as a number that is larger where a higher bit differs: the code's bits, then those of the
// position, which distinguish equal codes.
uvec3 difference_of(Words codes, uint i, uint j) {
    if (KEY_WORDS == 1) return uvec3(i ^ j, codes.word[i] ^ codes.word[j], 0);
    return uvec3(i ^ j, codes.word[2 * i] ^ codes.word[2 * j], codes.word[2 * i + 1] ^ codes.word[2 * j + 1]);
}

uvec3 difference_at(Words codes, uint i) {
    return difference_of(codes, i, i + 1);
}

// The highest bit of a difference, counted from the lowest of the position.
int highest_bit(uvec3 difference) {
    if (KEY_WORDS == 2 && difference.z != 0u) return 64 + findMSB(difference.z);
    return difference.y != 0u ? 32 + findMSB(difference.y) : findMSB(difference.x);
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
