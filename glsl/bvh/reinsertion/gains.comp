#version 460
// Sums what the moves of a round would gain, each for itself: see bvh/reinsertion.glsl for the contract.
#include "bvh/reinsertion.glsl"

void main() {
    begin_round(offset, since_fill);
    Sum64 sum = Sum64(0u, 0u);
    uint count = 0;
    for (uint k = 0, i = grid_item(0); i < tried(); i = grid_item(++k)) {
        count++;
        Move m = moves.move[i];
        if (m.to == NONE) continue;
        // Counted up to below 2^24; what is behind the point fits 32 bits exactly.
        float gain = min(uintBitsToFloat(m.gain), 16777215.0);
        uint whole = uint(gain);
        precise float parts = (gain - float(whole)) * 4294967296.0;
        add_to(sum, uint(parts));
        sum.high += whole;
    }
    add_to_words(sums, SUMS_GAINS, sum);
    if (count != 0u) atomicAdd(sums.word[SUMS_TRIED], count);
    Header header = structure.header;
    if (grid_item(0) == 0u) sums.word[SUMS_ROOT_AREA] = floatBitsToUint(scaled_half_area(box_of(header.root), header.area_scale));
}
