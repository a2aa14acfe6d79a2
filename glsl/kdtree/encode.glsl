// From triangles to the root's task: records, references and the cell around them. A *tile* is a chunk's worth of primitives.
#ifndef HEDGEROW_KDTREE_ENCODE
#define HEDGEROW_KDTREE_ENCODE
#include "kdtree/scan.glsl"
#include "kdtree/clip.glsl"

// A triangle is long if its longest side is this many octaves above the mean.
const uint LONG = 12;

uint tile_count() {
    return chunks_of(primitive_count);
}

// Words of a task's counters, and how many tasks have some at most.
uint counter_words() {
    return 6u * BINS + 1u;
}

uint counter_capacity() {
    return reference_capacity / CHUNK + 1u;
}

// What is counted from nothing on; by one invocation.
void clear_state() {
    KdState state = build_state();
    state.octaves[0] = 0u;
    state.octaves[1] = 0u;
    state.triangles_with_octave = 0u;
    state.longest = 0u;
    state.active_count = 0u;
    state.status = 0u;
    for (uint k = 0; k < 3; ++k) {
        state.lo[k] = NONE;
        state.hi[k] = 0u;
    }
    for (uint i = 0; i < LEVELS; ++i) {
        state.task_count[i] = 0u;
        state.chunk_count[i] = 0u;
        state.first_node[i] = 0u;
        state.first_subtree[i] = 0u;
        state.level_references[i] = 0u;
        state.binned_chunks[i] = 0u;
        state.classified[i] = 0u;
        state.scanned[i] = 0u;
        state.straddling[i] = 0u;
        state.first_leaf[i] = 0u;
    }
    state.ordered = 0u;
    state.node_count = 0u;
    state.subtree_count = 0u;
    state.leaf_count = 0u;
    state.root_references = 0u;
    state.inner_nodes = 0u;
    state.leaves = 0u;
    state.empty_leaves = 0u;
    state.depth = 0u;
    state.subtree_nodes = 0u;
    state.subtree_references = 0u;
    state.root_leaf_references = 0u;
    state.subtree_inner = 0u;
    state.subtree_leaves = 0u;
    state.subtree_empty = 0u;
    state.most_references = primitive_count;
    state.most_cut = primitive_count;
    state.most_nodes = 1u;
    state.most_subtrees = 1u;
    state.ended = 0u;
    state.is_short = 0u;
    state.first_record = 0u;
}

// The state, and where things lie in the scratch memory behind it: src/kdtree/builder.rs adds up the same.
void kd_reset() {
    if (gl_LocalInvocationIndex != 0u) return;
    KdState state = build_state();
    PoolState pool = PoolState(state_address);
    pool_reset(pool, PHASES);
    pool.tasks[PHASE_COUNT] = tile_count();
    pool.tasks[PHASE_PLAN] = 1u;
    pool.tasks[PHASE_RECORDS] = tile_count();
    pool.tasks[PHASE_ROOT] = 1u;
    pool.tasks[PHASE_ORDER] = 1u;
    uvec2 at = address_of(state_address, 1u, STATE_BYTES);
    state.references[0] = at;
    at = address_of(at, reference_capacity, 28u);
    state.references[1] = at;
    at = address_of(at, reference_capacity, 28u);
    state.tasks[0] = at;
    at = address_of(at, task_capacity, TASK_BYTES);
    state.tasks[1] = at;
    at = address_of(at, task_capacity, TASK_BYTES);
    state.subtrees = at;
    at = address_of(at, subtree_capacity, SUBTREE_BYTES);
    state.chunks = at;
    at = address_of(at, chunk_capacity + 1u, 8u);
    state.sides = at;
    at = address_of(at, reference_capacity, 4u);
    state.counters = at;
    at = address_of(at, counter_capacity(), 4u * counter_words());
    state.arrivals = at;
    at = address_of(at, tiles_of(chunk_capacity), 4u);
    state.chunk_tiles = at;
    at = address_of(at, tiles_of(chunk_capacity) + 1u, 8u);
    state.task_tiles = at;
    at = address_of(at, tiles_of(task_capacity) + 1u, SUMS_BYTES);
    state.subtree_tiles = at;
    at = address_of(at, tiles_of(subtree_capacity), 8u);
    state.nodes = at;
    at = address_of(at, subtree_node_room(), 8u);
    state.leaf_references = at;
    at = address_of(at, reference_room, 4u);
    state.stacks = at;
    clear_state();
}

// Which primitives there are, and how long their sides are; clears a part of the counters, and of the arrivals behind them.
void kd_count(uint tile) {
    KdState state = build_state();
    Geometry g = given_geometry();
    uint found = 0, octaves = 0, with_octave = 0, longest = 0, status = 0;
    for (uint k = 0; k < ITEMS; ++k) {
        uint i = tile * CHUNK + k * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        if (i >= primitive_count) break;
        Corners c;
        uint why_not = load_corners(g, i, c);
        status |= why_not & ~INACTIVE;
        if (why_not != 0u) continue;
        found += 1u;
        uint bits = floatBitsToUint(longest_side(box_around(c))), octave = bits >> 23;
        if (octave > 0u) {
            octaves += octave;
            with_octave += 1u;
            longest = max(longest, bits);
        }
    }
    // Triangles, their octaves, and triangles with one.
    uvec4 all;
    sum_before(uvec4(found, octaves, with_octave, 0u), all);
    longest = subgroupMax(longest);
    status = subgroupOr(status);
    if (subgroupElect()) {
        atomicMax(state.longest, longest);
        if (status != 0u) atomicOr(state.status, status);
    }
    if (gl_LocalInvocationIndex == 0u) {
        chunk_sides().side[first_tile + tile] = uvec2(all.x, 0u);
        uint before = atomicAdd(state.octaves[0], all.y);
        if (before + all.y < before) atomicAdd(state.octaves[1], 1u);
        atomicAdd(state.triangles_with_octave, all.z);
    }
    Words all_counters = Words(state.counters);
    // A build across levels has none.
    uint words = state.counters == uvec2(0) ? 0u : counter_capacity() * counter_words() + tiles_of(chunk_capacity);
    uint share = (words + tile_count() - 1u) / tile_count();
    uint end = min(words, (tile + 1u) * share);
    for (uint i = tile * share + gl_LocalInvocationIndex; i < end; i += gl_WorkGroupSize.x) all_counters.word[i] = 0u;
    barrier();
}

// The mean of the octaves, rounded down: at most 254.
uint mean_octave(KdState state) {
    uint mean = 0, count = max(state.triangles_with_octave, 1u);
    for (int bit = 7; bit >= 0; --bit) {
        uint high, low, larger = mean | 1u << bit;
        umulExtended(larger, count, high, low);
        if (high < state.octaves[1] || high == state.octaves[1] && low <= state.octaves[0]) mean = larger;
    }
    return mean;
}

// Where the records of each tile begin; how long a triangle may be to be referenced only where it is.
void kd_plan() {
    KdState state = build_state();
    uint found = scan_chunks(tile_count()).x;
    if (gl_LocalInvocationIndex != 0u) return;
    state.active_count = found;
    uint octave = min(mean_octave(state) + LONG, 254u);
    state.reach = min(uintBitsToFloat(state.longest), uintBitsToFloat(octave << 23));
}

void kd_records(uint tile) {
    KdState state = build_state();
    Geometry g = given_geometry();
    Triangles records = Triangles(kd_records_at(structure_address, node_room, reference_room));
    KdReferences references = references_of(0u);
    uint at = chunk_sides().side[first_tile + tile].x, first_record = state.first_record;
    float reach = state.reach;
    uvec3 lo = uvec3(NONE), hi = uvec3(0);
    for (uint k = 0; k < ITEMS; ++k) {
        uint i = tile * CHUNK + k * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        Corners c;
        bool is_there = i < primitive_count && load_corners(g, i, c) == 0u;
        uint total;
        uint record = at + sum_before(is_there ? 1u : 0u, total);
        at += total;
        if (is_there && first_record + record < record_room) {
            records.triangle[first_record + record] = Triangle(c.v0, c.v1, c.v2, first_primitive + i);
            Box b = bounds_of(c, reach), cell = cell_around(c, reach);
            references.reference[record] = KdReference(b.lo, first_record + record, b.hi);
            lo = min(lo, ordered(cell.lo));
            hi = max(hi, ordered(cell.hi));
        }
    }
    lo = subgroupMin(lo);
    hi = subgroupMax(hi);
    if (subgroupElect()) {
        for (uint k = 0; k < 3; ++k) {
            atomicMin(state.lo[k], lo[k]);
            atomicMax(state.hi[k], hi[k]);
        }
    }
}

// The cell around all triangles.
Box root_cell() {
    KdState state = build_state();
    Box cell = Box(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
    uint count = state.active_count;
    if (count > 0u) {
        cell = Box(from_ordered(uvec3(state.lo[0], state.lo[1], state.lo[2])),
                   from_ordered(uvec3(state.hi[0], state.hi[1], state.hi[2])));
    }
    if (gl_LocalInvocationIndex == 0u) {
        state.cell_lo = cell.lo;
        state.cell_hi = cell.hi;
        state.area_scale = count > 0u ? area_scale_of(cell) : 1.0;
        state.empty_leaves = count > 0u ? 0u : 1u;
    }
    return cell;
}

void kd_root() {
    Box cell = root_cell();
    uint count = build_state().active_count;
    if (gl_LocalInvocationIndex == 0u) {
        Sums sums = no_sums();
        add_task(sums, count, 0u);
        publish_level(0u, sums, count);
    }
    next_phase();
    // One task, of the first invocation.
    KdTask root = new_task(cell, 0u, gl_LocalInvocationIndex == 0u ? count : 0u, 0u), none = new_task(cell, 0u, 0u, 0u);
    Sums sums = no_sums();
    write_tasks(0u, root, none, sums);
}
#endif
