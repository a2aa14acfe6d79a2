// One pass of a stable radix sort over one digit: count, scan, scatter (Satish, Harris, Garland 2009: reduce, then scan).
// Needs no progress of other workgroups. src/gpu/radix_sort.rs records it and holds its twin.
//
// A *column* is what one counter column of the table counts: a strip of keys of one invocation (PRIVATE_COUNTERS, for CPUs:
// no atomics, no ballots, no barriers) or the tile of a workgroup (for GPUs: coalesced, ranked by ballots).
// The table holds count[digit][column], then DIGITS totals behind it.
//
//   count    reads keys                   writes table
//   scan     reads table                  writes table (exclusive along each row) and totals
//   scatter  reads keys, values, table    writes keys_out, values_out
//
// needs one barrier between each two; subgroups of any size; a workgroup of whole subgroups, at most 8 of them where
// PRIVATE_COUNTERS is off
#ifndef HEDGEROW_GPU_RADIX_SORT
#define HEDGEROW_GPU_RADIX_SORT
#include "gpu/pass.glsl"

layout(constant_id = 2) const uint DIGIT_BITS = 8;
layout(constant_id = 3) const bool PRIVATE_COUNTERS = true;
layout(constant_id = 4) const uint KEY_WORDS = 1;
const uint DIGITS = 1u << DIGIT_BITS;
const uint SUBGROUPS_AT_MOST = 8;
// Keys of a lane in a tile, and with them the registers that remember ranks.
const uint ROWS = 16;

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

shared uint radix_counters[DIGITS * SUBGROUPS_AT_MOST];
shared uint radix_partial[SUBGROUPS_AT_MOST];

uvec2 radix_key(Words keys, uint i) {
    return KEY_WORDS == 1 ? uvec2(keys.word[i], 0) : uvec2(keys.word[2 * i], keys.word[2 * i + 1]);
}

// The digit of a key, low word first.
uint radix_digit(uvec2 key, uint shift) {
    uint bits = shift >= 32 ? key.y >> (shift - 32) : shift == 0 ? key.x : key.x >> shift | key.y << (32 - shift);
    return bits & (DIGITS - 1);
}

void radix_store(Radix r, uint at, uvec2 key, uint value) {
    if (KEY_WORDS == 1) {
        r.keys_out.word[at] = key.x;
    } else {
        r.keys_out.word[2 * at] = key.x;
        r.keys_out.word[2 * at + 1] = key.y;
    }
    r.values_out.word[at] = value;
}

// The column of private counters in which this invocation counts; no other touches it.
uint radix_slot(uint digit) {
    return digit * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

void radix_count_strip(Radix r, uint task) {
    uint column = task * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (column >= r.columns) return;
    for (uint digit = 0; digit < DIGITS; ++digit) radix_counters[radix_slot(digit)] = 0;
    uint end = min(r.count, (column + 1) * r.column_keys);
    for (uint i = column * r.column_keys; i < end; ++i) {
        radix_counters[radix_slot(radix_digit(radix_key(r.keys, i), r.shift))]++;
    }
    for (uint digit = 0; digit < DIGITS; ++digit) {
        r.table.word[digit * r.columns + column] = radix_counters[radix_slot(digit)];
    }
}

void radix_scatter_strip(Radix r, uint task) {
    uint column = task * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (column >= r.columns) return;
    uint before = 0;
    for (uint digit = 0; digit < DIGITS; ++digit) {
        radix_counters[radix_slot(digit)] = before + r.table.word[digit * r.columns + column];
        before += r.table.word[DIGITS * r.columns + digit];
    }
    uint end = min(r.count, (column + 1) * r.column_keys);
    for (uint i = column * r.column_keys; i < end; ++i) {
        uvec2 key = radix_key(r.keys, i);
        uint value = r.identity ? i : r.values.word[i];
        uint slot = radix_slot(radix_digit(key, r.shift));
        uint at = radix_counters[slot];
        radix_counters[slot] = at + 1;
        radix_store(r, at, key, value);
    }
}

void radix_count_tile(Radix r, uint column) {
    uint local = gl_LocalInvocationIndex;
    for (uint digit = local; digit < DIGITS; digit += gl_WorkGroupSize.x) radix_counters[digit] = 0;
    barrier();
    uint end = min(r.count, (column + 1) * r.column_keys);
    for (uint i = column * r.column_keys + local; i < end; i += gl_WorkGroupSize.x) {
        atomicAdd(radix_counters[radix_digit(radix_key(r.keys, i), r.shift)], 1);
    }
    barrier();
    for (uint digit = local; digit < DIGITS; digit += gl_WorkGroupSize.x) {
        r.table.word[digit * r.columns + column] = radix_counters[digit];
    }
    barrier();   // the counters may be used again by the next task
}

// The lanes of the subgroup that are active and have the same digit as this one.
uvec4 radix_peers(uint digit) {
    uvec4 peers = subgroupBallot(true);
    for (uint bit = 0; bit < DIGIT_BITS; ++bit) {
        bool is_set = (digit >> bit & 1) != 0;
        uvec4 set_lanes = subgroupBallot(is_set);
        peers &= is_set ? set_lanes : ~set_lanes;
    }
    return peers;
}

// Turns radix_counters[subgroup][digit] from counts into output positions: behind all smaller digits, behind the tiles before
// (the table), behind the subgroups before.
void radix_offsets_of_tile(Radix r, uint column) {
    uint lanes = gl_WorkGroupSize.x;
    uint before = 0;   // keys with a digit below this round's
    for (uint first = 0; first < DIGITS; first += lanes) {
        uint digit = first + gl_LocalInvocationIndex;
        uint total = digit < DIGITS ? r.table.word[DIGITS * r.columns + digit] : 0;
        uint in_subgroup = subgroupExclusiveAdd(total);
        uint subgroup_total = subgroupAdd(total);
        if (subgroupElect()) radix_partial[gl_SubgroupID] = subgroup_total;
        barrier();
        uint at = before + in_subgroup;
        for (uint s = 0; s < gl_NumSubgroups; ++s) {
            if (s < gl_SubgroupID) at += radix_partial[s];
            before += radix_partial[s];
        }
        if (digit < DIGITS) {
            at += r.table.word[digit * r.columns + column];
            for (uint s = 0; s < gl_NumSubgroups; ++s) {
                uint count = radix_counters[s * DIGITS + digit];
                radix_counters[s * DIGITS + digit] = at;
                at += count;
            }
        }
        barrier();
    }
}

void radix_scatter_tile(Radix r, uint column) {
    for (uint i = gl_LocalInvocationIndex; i < DIGITS * gl_NumSubgroups; i += gl_WorkGroupSize.x) radix_counters[i] = 0;
    barrier();
    // A subgroup owns ROWS rows of consecutive keys; a key's rank is its row's start plus the equal digits before it in the row.
    uint first = column * r.column_keys + gl_SubgroupID * ROWS * gl_SubgroupSize + gl_SubgroupInvocationID;
    uint counters = gl_SubgroupID * DIGITS;
    uint ranks[ROWS];
    for (uint row = 0; row < ROWS; ++row) {
        uint i = first + row * gl_SubgroupSize;
        if (i < r.count) {
            uint digit = radix_digit(radix_key(r.keys, i), r.shift);
            uvec4 peers = radix_peers(digit);
            ranks[row] = radix_counters[counters + digit] + subgroupBallotExclusiveBitCount(peers);
            subgroupMemoryBarrierShared();
            if (subgroupBallotFindMSB(peers) == gl_SubgroupInvocationID) radix_counters[counters + digit] = ranks[row] + 1;
        }
        subgroupMemoryBarrierShared();
        subgroupBarrier();
    }
    barrier();
    radix_offsets_of_tile(r, column);
    for (uint row = 0; row < ROWS; ++row) {
        uint i = first + row * gl_SubgroupSize;
        if (i < r.count) {
            uvec2 key = radix_key(r.keys, i);
            uint value = r.identity ? i : r.values.word[i];
            radix_store(r, radix_counters[counters + radix_digit(key, r.shift)] + ranks[row], key, value);
        }
    }
    barrier();   // the counters may be used again by the next task
}

// Exclusive scan of row `digit` of the table, its sum into the totals: by one invocation.
void radix_scan_row(Radix r, uint digit) {
    uint sum = 0;
    for (uint column = 0; column < r.columns; ++column) {
        uint count = r.table.word[digit * r.columns + column];
        r.table.word[digit * r.columns + column] = sum;
        sum += count;
    }
    r.table.word[DIGITS * r.columns + digit] = sum;
}

// The same by a workgroup.
void radix_scan_row_together(Radix r, uint digit) {
    uint sum = 0;
    for (uint first = 0; first < r.columns; first += gl_WorkGroupSize.x) {
        uint column = first + gl_LocalInvocationIndex;
        uint count = column < r.columns ? r.table.word[digit * r.columns + column] : 0;
        uint in_subgroup = subgroupExclusiveAdd(count);
        uint subgroup_total = subgroupAdd(count);
        if (subgroupElect()) radix_partial[gl_SubgroupID] = subgroup_total;
        barrier();
        uint before = sum;
        for (uint s = 0; s < gl_NumSubgroups; ++s) {
            if (s < gl_SubgroupID) before += radix_partial[s];
            sum += radix_partial[s];
        }
        if (column < r.columns) r.table.word[digit * r.columns + column] = before + in_subgroup;
        barrier();
    }
    if (gl_LocalInvocationIndex == 0) r.table.word[DIGITS * r.columns + digit] = sum;
}

// The three steps as tasks of a workgroup: how many there are is told by radix_tasks in src/gpu/radix_sort.rs.
void radix_count(Radix r, uint task) {
    if (PRIVATE_COUNTERS) radix_count_strip(r, task);
    else radix_count_tile(r, task);
}

void radix_scan(Radix r, uint task) {
    if (!PRIVATE_COUNTERS) {
        radix_scan_row_together(r, task);
    } else {
        uint digit = task * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        if (digit < DIGITS) radix_scan_row(r, digit);
    }
}

void radix_scatter(Radix r, uint task) {
    if (PRIVATE_COUNTERS) radix_scatter_strip(r, task);
    else radix_scatter_tile(r, task);
}
#endif
