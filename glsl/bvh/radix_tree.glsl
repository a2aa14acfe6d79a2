// The binary radix tree of sorted codes, bottom-up (Apetrei 2014): the node that splits between positions i and i + 1 has slot i,
// and the parent of the positions first..=last is that of the two neighbouring splits whose codes differ in the lower bit.
#ifndef HEDGEROW_BVH_RADIX_TREE
#define HEDGEROW_BVH_RADIX_TREE
#include "gpu/radix_sort.glsl"

// Two codes in sorted order, and the positions that they have, first differ in a bit, counted from the lowest of a position: the code's
// bits are above the 32 of the position, which distinguish equal codes. The splits before and behind a subtree never have the same
// bit.
const uint POSITION_WORD_BITS = 32;
// In place of the bit at either end of all positions, where there is no split: above every bit.
const uint NO_SPLIT = 127;
const uint SPLIT_BITS = 7;

uvec2 code_at(Words codes, uint i) {
    if (KEY_WORDS == 1) return uvec2(codes.word[i], 0u);
    return uvec2(codes.word[2 * i], codes.word[2 * i + 1]);
}

uint highest_bit(uvec2 code, uvec2 other, uint i, uint j) {
    uvec2 difference = code ^ other;
    uint word = i ^ j, below = 0u;
    if (difference.x != 0u) word = difference.x, below = POSITION_WORD_BITS;
    if (KEY_WORDS == 2 && difference.y != 0u) word = difference.y, below = 2u * POSITION_WORD_BITS;
    return below + uint(findMSB(word));
}

// Of the codes at two positions.
uint bit_between(Words codes, uint i, uint j) {
    return highest_bit(code_at(codes, i), code_at(codes, j), i, j);
}

// Of the split behind position i, or before position i.
uint split_behind(Words codes, uint i, uint active_count) {
    return i + 1u < active_count ? bit_between(codes, i, i + 1u) : NO_SPLIT;
}

uint split_before(Words codes, uint i) {
    return i > 0u ? bit_between(codes, i - 1u, i) : NO_SPLIT;
}

// Of the split behind position i, whose code is given and becomes that of the next.
uint split_to_next(Words codes, uint i, uint active_count, inout uvec2 code) {
    uint split = NO_SPLIT;
    if (i + 1u < active_count) {
        uvec2 next = code_at(codes, i + 1u);
        split = highest_bit(code, next, i, i + 1u);
        code = next;
    }
    return split;
}
#endif
