// The radix sort's tiles: a workgroup counts, and later places, the keys of a tile. See gpu/radix_sort.glsl.
//
// To be placed keys are read once and stay in registers. Ranks among equal digits come from ballots (a subgroup's keys) and
// counters (the subgroups before). Then the tile is put in order in shared memory, one word of each key at a time, so that the
// keys of a digit leave it side by side: a store of a subgroup fills whole sectors where digits have eight keys or more.
//
// The table is tile-major: a tile writes and reads its counts side by side, and scanning takes eight digits at a time, a sector.
#ifndef HEDGEROW_GPU_RADIX_SORT_TILES
#define HEDGEROW_GPU_RADIX_SORT_TILES
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_EXT_control_flow_attributes : require

const uint TILE_SUBGROUPS = PRIVATE_COUNTERS ? 1u : TILE_WORD & 0xFFFFu;
// Keys of a lane, which are in registers: drivers unroll the loops over them.
const uint TILE_ROWS = PRIVATE_COUNTERS ? 1u : TILE_WORD >> 16;
const uint TILE_LANES = gl_WorkGroupSize.x / TILE_SUBGROUPS;
const uint TILE_KEYS = gl_WorkGroupSize.x * TILE_ROWS;
const uint TILE_COUNTERS = DIGITS * TILE_SUBGROUPS;
// The most of what lies there one after the other; a tile has at least as many keys as there are lanes.
const uint TILE_WORDS = TILE_COUNTERS > TILE_KEYS ? TILE_COUNTERS : TILE_KEYS;
// Columns whose counts are loaded before the first is used.
const uint SCANNED_AHEAD = 8;

// First the counters of each subgroup, then a word of each key in order.
shared uint tile_words[PRIVATE_COUNTERS ? 1u : TILE_WORDS];
// What is added to a key's place in the tile to get its place among all keys, by digits.
shared uint tile_offsets[PRIVATE_COUNTERS ? 1u : DIGITS];
shared uvec2 tile_partial[PRIVATE_COUNTERS ? 1u : TILE_SUBGROUPS];

// ---- count ----

void radix_count_tile(Radix r, uint column) {
    uint local = gl_LocalInvocationIndex;
    for (uint digit = local; digit < DIGITS; digit += gl_WorkGroupSize.x) tile_words[digit] = 0;
    barrier();
    uint end = min(r.count, (column + 1) * r.column_keys);
    for (uint i = column * r.column_keys + local; i < end; i += gl_WorkGroupSize.x) {
        atomicAdd(tile_words[radix_digit(radix_key(r.keys, i), r.shift)], 1);
    }
    barrier();
    for (uint digit = local; digit < DIGITS; digit += gl_WorkGroupSize.x) {
        r.table.word[column * DIGITS + digit] = tile_words[digit];
    }
    barrier();   // the counters may be used again by the next task
}

// ---- scan ----

// Each digit's counts are cut into strips, of which a lane has one: it sums it, then scans it from the sum of those before.
void radix_scan_digits(Radix r, uint task) {
    uint strips = gl_WorkGroupSize.x / SCANNED_TOGETHER;
    uint own = gl_LocalInvocationIndex % SCANNED_TOGETHER, strip = gl_LocalInvocationIndex / SCANNED_TOGETHER;
    uint digit = task * SCANNED_TOGETHER + own;
    uint length = (r.columns + strips - 1) / strips;
    uint begin = min(strip * length, r.columns), end = min(begin + length, r.columns);
    if (digit >= DIGITS || strip >= strips) end = begin;
    uint sum = 0;
    for (uint first = begin; first < end; first += SCANNED_AHEAD) {
        [[unroll]] for (uint k = 0; k < SCANNED_AHEAD; ++k) {
            sum += first + k < end ? r.table.word[(first + k) * DIGITS + digit] : 0;
        }
    }
    tile_words[gl_LocalInvocationIndex] = sum;
    barrier();
    sum = 0;
    for (uint s = 0; s < min(strip, strips); ++s) sum += tile_words[s * SCANNED_TOGETHER + own];
    for (uint first = begin; first < end; first += SCANNED_AHEAD) {
        uint counts[SCANNED_AHEAD];
        [[unroll]] for (uint k = 0; k < SCANNED_AHEAD; ++k) {
            counts[k] = first + k < end ? r.table.word[(first + k) * DIGITS + digit] : 0;
        }
        [[unroll]] for (uint k = 0; k < SCANNED_AHEAD; ++k) {
            if (first + k < end) r.table.word[(first + k) * DIGITS + digit] = sum;
            sum += counts[k];
        }
    }
    if (digit < DIGITS && strip + 1 == strips) r.table.word[DIGITS * r.columns + digit] = sum;
    barrier();   // the shared memory may be used again by the next task
}

// ---- scatter ----

// The lanes of the subgroup that have the same digit as this one; all lanes are active.
uvec4 radix_peers(uint digit) {
    uvec4 peers = subgroupBallot(true);
    // A copy for each bit and row makes compilers slow: lavapipe's took minutes.
    [[dont_unroll]] for (uint bit = 0; bit < DIGIT_BITS; ++bit) {
        bool is_set = (digit >> bit & 1) != 0;
        uvec4 set_lanes = subgroupBallot(is_set);
        peers &= is_set ? set_lanes : ~set_lanes;
    }
    return peers;
}

// How many of the subgroup's keys so far have this digit; then they are more by those of this row.
uint radix_rank(uint digit) {
    uvec4 peers = radix_peers(digit);
    // One of them reads and writes the counter, so that nobody reads what another is about to write.
    uint leader = subgroupBallotFindMSB(peers), counter = gl_SubgroupID * DIGITS + digit, before = 0;
    if (leader == gl_SubgroupInvocationID) {
        before = tile_words[counter];
        tile_words[counter] = before + subgroupBallotBitCount(peers);
    }
    subgroupBarrier();   // the leaders of the next row are others
    return subgroupShuffle(before, leader) + subgroupBallotExclusiveBitCount(peers);
}

// The sums of what lanes before have, and of all.
uvec2 radix_sum_before(uvec2 value, out uvec2 total) {
    uvec2 before = subgroupExclusiveAdd(value), own_total = subgroupAdd(value);
    if (subgroupElect()) tile_partial[gl_SubgroupID] = own_total;
    barrier();
    total = uvec2(0);
    for (uint s = 0; s < gl_NumSubgroups; ++s) {
        if (s < gl_SubgroupID) before += tile_partial[s];
        total += tile_partial[s];
    }
    barrier();
    return before;
}

// Turns the counters from counts into places in the tile: behind all smaller digits, behind the subgroups before.
void radix_places_of_tile(Radix r, uint column) {
    uvec2 before = uvec2(0);   // keys with a digit below this round's: of all keys, of the tile
    for (uint first = 0; first < DIGITS; first += gl_WorkGroupSize.x) {
        uint digit = first + gl_LocalInvocationIndex;
        uvec2 counts = uvec2(0), total;
        if (digit < DIGITS) {
            counts.x = r.table.word[DIGITS * r.columns + digit];
            for (uint s = 0; s < TILE_SUBGROUPS; ++s) counts.y += tile_words[s * DIGITS + digit];
        }
        uvec2 at = before + radix_sum_before(counts, total);
        before += total;
        if (digit < DIGITS) {
            tile_offsets[digit] = at.x + r.table.word[column * DIGITS + digit] - at.y;
            for (uint s = 0; s < TILE_SUBGROUPS; ++s) {
                uint count = tile_words[s * DIGITS + digit];
                tile_words[s * DIGITS + digit] = at.y;
                at.y += count;
            }
        }
    }
}

void radix_scatter_tile(Radix r, uint column) {
    for (uint i = gl_LocalInvocationIndex; i < TILE_COUNTERS; i += gl_WorkGroupSize.x) tile_words[i] = 0;
    barrier();
    // A subgroup owns rows of consecutive keys. Where keys are left out, there may be none in the tile.
    uint first = column * TILE_KEYS, left = max(r.count, first) - first;
    uint own = gl_SubgroupID * TILE_ROWS * TILE_LANES + gl_SubgroupInvocationID;
    uvec2 keys[TILE_ROWS];
    uint places[TILE_ROWS];
    // What is behind the last key has the largest digit, and so a place behind all keys.
    [[unroll]] for (uint row = 0; row < TILE_ROWS; ++row) {
        uint i = own + row * TILE_LANES;
        keys[row] = i < left ? radix_key(r.keys, first + i) : uvec2(0xFFFFFFFFu);
    }
    [[unroll]] for (uint row = 0; row < TILE_ROWS; ++row) places[row] = radix_rank(radix_digit(keys[row], r.shift));
    barrier();
    radix_places_of_tile(r, column);
    barrier();
    uint counters = gl_SubgroupID * DIGITS;
    [[unroll]] for (uint row = 0; row < TILE_ROWS; ++row) {
        places[row] += tile_words[counters + radix_digit(keys[row], r.shift)];
    }
    // Lane by lane in order from here on. The first barrier ends the counters, the others what lay there before.
    for (uint word = 0; word < KEY_WORDS; ++word) {
        barrier();
        // Selects: a branch for each row in one loop is more than SwiftShader's compiler can follow.
        bvec2 is_word = bvec2(word == 0, word == 1);
        [[unroll]] for (uint row = 0; row < TILE_ROWS; ++row) tile_words[places[row]] = mix(keys[row].y, keys[row].x, is_word.x);
        barrier();
        [[unroll]] for (uint row = 0; row < TILE_ROWS; ++row) {
            uvec2 in_order = uvec2(tile_words[row * gl_WorkGroupSize.x + gl_LocalInvocationIndex]);
            keys[row] = mix(keys[row], in_order, is_word);
            // A key of one word has no other, whatever the lane had behind the last.
            if (KEY_WORDS == 1) keys[row].y = 0;
        }
    }
    barrier();
    [[unroll]] for (uint row = 0; row < TILE_ROWS; ++row) {
        uint i = own + row * TILE_LANES;
        tile_words[places[row]] = i < left ? radix_value(r, first + i) : 0;
    }
    barrier();
    [[unroll]] for (uint row = 0; row < TILE_ROWS; ++row) {
        uint i = row * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        if (i < left) {
            uint at = i + tile_offsets[radix_digit(keys[row], r.shift)];
            radix_store_key(r, at, keys[row]);
            r.values_out.word[at] = tile_words[i];
        }
    }
    barrier();   // the shared memory may be used again by the next task
}
#endif
