// One pass of a stable radix sort over one digit: count, scan, scatter (Satish, Harris, Garland 2009: reduce, then scan).
// Needs no progress of other workgroups. src/gpu/radix_sort.rs records it and holds its twin.
//
// A *column* is what one counter a digit counts: a strip of keys of one invocation (gpu/radix_sort/strips.glsl, for CPUs: no
// atomics, no ballots, no barriers) or the tile of a workgroup (gpu/radix_sort/tiles.glsl, for GPUs: coalesced, ranked by
// ballots). The table holds a count for each digit and column, then DIGITS totals behind them.
//
//   count    reads keys                   writes table
//   scan     reads table                  writes table (exclusive along each digit) and totals
//   scatter  reads keys, values, table    writes keys_out, values_out
//
// needs one barrier between each two; strips: subgroups of any size; tiles: workgroups of TILE_SUBGROUPS whole subgroups
#ifndef HEDGEROW_GPU_RADIX_SORT
#define HEDGEROW_GPU_RADIX_SORT
#include "gpu/pass.glsl"

layout(constant_id = 2) const uint DIGIT_BITS = 8;
// 0: strips; otherwise the subgroups of a workgroup, keys of a lane in a tile << 16: Shape in src/gpu/radix_sort.rs.
layout(constant_id = 3) const uint TILE_WORD = 0;
layout(constant_id = 4) const uint KEY_WORDS = 1;
const uint DIGITS = 1u << DIGIT_BITS;
const bool PRIVATE_COUNTERS = TILE_WORD == 0u;
const uint SUBGROUPS_AT_MOST = 8;
// Digits whose counts of a tile fill a sector of 32 bytes: what a workgroup scans together.
const uint SCANNED_TOGETHER = 8;
// What a task of the steps takes: columns of count and scatter, digits of scan.
const uint COLUMNS_A_TASK = PRIVATE_COUNTERS ? gl_WorkGroupSize.x : 1u;
const uint DIGITS_A_TASK = PRIVATE_COUNTERS ? gl_WorkGroupSize.x : SCANNED_TOGETHER;

struct Radix {
    Words keys;
    Words values;
    Words keys_out;
    Words values_out;
    Words table;
    uint count;
    uint shift;
    uint columns;
    uint column_keys;   // keys of a column
    bool identity;      // values are 0, 1, 2 …: not read
};

// Strips of fewer keys than there is room for are shorter, so that all have as much to do.
uint keys_of_column(uint count, uint columns, uint most) {
    return PRIVATE_COUNTERS ? min((count + columns - 1u) / columns, most) : most;
}

uvec2 radix_key(Words keys, uint i) {
    return KEY_WORDS == 1 ? uvec2(keys.word[i], 0) : uvec2(keys.word[2 * i], keys.word[2 * i + 1]);
}

// The digit of a key, low word first.
uint radix_digit(uvec2 key, uint shift) {
    uint bits = shift >= 32 ? key.y >> (shift - 32) : shift == 0 ? key.x : key.x >> shift | key.y << (32 - shift);
    return bits & (DIGITS - 1);
}

void radix_store_key(Radix r, uint at, uvec2 key) {
    if (KEY_WORDS == 1) {
        r.keys_out.word[at] = key.x;
    } else {
        r.keys_out.word[2 * at] = key.x;
        r.keys_out.word[2 * at + 1] = key.y;
    }
}

uint radix_value(Radix r, uint i) {
    return r.identity ? i : r.values.word[i];
}

#include "gpu/radix_sort/strips.glsl"
#include "gpu/radix_sort/tiles.glsl"

// The three steps as tasks of a workgroup.
void radix_count(Radix r, uint task) {
    if (PRIVATE_COUNTERS) radix_count_strip(r, task);
    else radix_count_tile(r, task);
}

void radix_scan(Radix r, uint task) {
    if (PRIVATE_COUNTERS) radix_scan_row(r, task);
    else radix_scan_digits(r, task);
}

void radix_scatter(Radix r, uint task) {
    if (PRIVATE_COUNTERS) radix_scatter_strip(r, task);
    else radix_scatter_tile(r, task);
}
#endif
