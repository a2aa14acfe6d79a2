// The radix sort's strips: each invocation counts, and later places, the keys of a strip of its own. See gpu/radix_sort.glsl.
//
// The table is digit-major: the counts of a digit in all strips are a row.
#ifndef HEDGEROW_GPU_RADIX_SORT_STRIPS
#define HEDGEROW_GPU_RADIX_SORT_STRIPS

shared uint strip_counters[PRIVATE_COUNTERS ? DIGITS * gl_WorkGroupSize.x : 1u];

// Where this invocation counts a digit; no other touches it.
uint radix_slot(uint digit) {
    return digit * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

void radix_count_strip(Radix r, uint task) {
    uint column = task * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (column >= r.columns) return;
    for (uint digit = 0; digit < DIGITS; ++digit) strip_counters[radix_slot(digit)] = 0;
    uint end = min(r.count, (column + 1) * r.column_keys);
    for (uint i = column * r.column_keys; i < end; ++i) {
        strip_counters[radix_slot(radix_digit(radix_key(r.keys, i), r.shift))]++;
    }
    for (uint digit = 0; digit < DIGITS; ++digit) {
        r.table.word[digit * r.columns + column] = strip_counters[radix_slot(digit)];
    }
}

// Exclusive scan of the rows of as many digits as there are invocations, their sums into the totals.
void radix_scan_row(Radix r, uint task) {
    uint digit = task * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (digit >= DIGITS) return;
    uint sum = 0;
    for (uint column = 0; column < r.columns; ++column) {
        uint count = r.table.word[digit * r.columns + column];
        r.table.word[digit * r.columns + column] = sum;
        sum += count;
    }
    r.table.word[DIGITS * r.columns + digit] = sum;
}

void radix_scatter_strip(Radix r, uint task) {
    uint column = task * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (column >= r.columns) return;
    uint before = 0;
    for (uint digit = 0; digit < DIGITS; ++digit) {
        strip_counters[radix_slot(digit)] = before + r.table.word[digit * r.columns + column];
        before += r.table.word[DIGITS * r.columns + digit];
    }
    uint end = min(r.count, (column + 1) * r.column_keys);
    for (uint i = column * r.column_keys; i < end; ++i) {
        uvec2 key = radix_key(r.keys, i);
        uint value = radix_value(r, i);
        uint slot = radix_slot(radix_digit(key, r.shift));
        uint at = strip_counters[slot];
        strip_counters[slot] = at + 1;
        radix_store_key(r, at, key);
        r.values_out.word[at] = value;
    }
}
#endif
