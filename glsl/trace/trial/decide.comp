#version 460
// Whether the copy takes less work: see trace/trial.glsl for the contract. One invocation.
#include "trace/trial.glsl"

// src/trace/trial.rs says how much less.
const uint OF_COPY = 100;
const uint OF_STRUCTURE = 99;

// 64 bits times a small number: below 2^96.
uvec3 times(uint at, uint factor) {
    uint low, middle, high, carried;
    umulExtended(result.word[at], factor, carried, low);
    umulExtended(result.word[at + 1u], factor, high, middle);
    uint carry;
    middle = uaddCarry(middle, carried, carry);
    return uvec3(low, middle, high + carry);
}

bool is_less(uvec3 a, uvec3 b) {
    if (a.z != b.z) return a.z < b.z;
    if (a.y != b.y) return a.y < b.y;
    return a.x < b.x;
}

void main() {
    if (invocation_number() != 0u) return;
    Header header = structure.header, of_copy = copy.header;
    bool can_be_taken = are_of_one(header, of_copy) && (of_copy.status & STATUS_UNUSABLE) == 0u;
    bool is_taken = can_be_taken && is_less(times(RESULT_COPY, OF_COPY), times(RESULT_STRUCTURE, OF_STRUCTURE));
    result.word[RESULT_IS_TAKEN] = is_taken ? 1u : 0u;
}
