#version 460
// All rounds on a small tree, by one workgroup: see bvh/reinsertion.glsl for the contract.
//
// A chain of dispatches costs a small tree more than its work.
#define HEDGEROW_ONE_WORKGROUP
#include "bvh/reinsertion/match.glsl"
#include "bvh/reinsertion/move.glsl"
#include "bvh/reinsertion/parents.glsl"
#include "bvh/reinsertion/search.glsl"
#include "bvh/reinsertion/settle.glsl"

void clear_gains() {
    for (uint i = gl_LocalInvocationIndex; i < link_count / 2u; i += gl_WorkGroupSize.x) {
        gains.word[i] = 0u;
        firsts.word[i] = 0u;
    }
}

void main() {
    find_parents();
    for (uint round = 0; round < rounds; ++round) {
        begin_round((offset + round) % stride, round % ROUNDS_A_FILL);
        if (round % ROUNDS_A_FILL == 0u) clear_gains();
        next_phase();
        search_moves();
        next_phase();
        match_moves();
        next_phase();
        settle_moves();
        next_phase();
        make_moves();
        next_phase();
    }
}
