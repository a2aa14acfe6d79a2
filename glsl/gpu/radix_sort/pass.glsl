// What a dispatch of the radix sort is given: see gpu/radix_sort.glsl. src/gpu/radix_sort.rs records it.
//
// reads   what is left out, if something may be
#ifndef HEDGEROW_GPU_RADIX_SORT_PASS
#define HEDGEROW_GPU_RADIX_SORT_PASS
#include "gpu/radix_sort.glsl"

// Whether something may be left out: a driver on a CPU loads from a null address though no lane is there.
layout(constant_id = 5) const bool LEAVES_OUT = false;

layout(push_constant, scalar) uniform RadixSortArguments {
    Words keys;
    Words values;
    Words keys_out;
    Words values_out;
    Words table;
    Words left_out;     // how many of the passes, the first, are left out, and how many of the keys, the last
    uint count;
    uint pass;
    uint columns;
    uint column_keys;
    uint identity;      // values are 0, 1, 2 … before the first pass
};

// The pass; false if it is left out.
bool is_done(out Radix r) {
    uint before = 0u, keys_left = count;
    if (LEAVES_OUT) {
        before = left_out.word[0];
        keys_left -= left_out.word[1];
    }
    uint done = pass - min(before, pass);
    r = Radix(keys, values, keys_out, values_out, table, keys_left, done * DIGIT_BITS, columns, keys_of_column(keys_left, columns, column_keys),
              identity != 0 && done == 0);
    return pass >= before;
}
#endif
