// From primitives to an order: the phases that every builder begins with, each a function over a task (a workgroup's worth of
// items): dispatched one by one (bvh/encode/*.comp, gpu/radix_sort/*.comp) or from the task pool by the builder's persistent
// kernel. src/bvh/encode.rs records them; a hierarchy follows.
//
//   reset      writes state: empty bounds, the pool
//   (fences    reads the primitives                    writes state: the fences, of codes that have sections; in a chain with reset)
//   bounds     reads the primitives, fences            writes state: bounds, core, active_count, status
//   plan       reads state: bounds                     writes state: plan; the structure's header and table of geometries
//   (cells     reads the primitives, plan              writes table: the cells of a grid, in codes that have one
//   prefixes   reads table                             writes table: what the cells say)
//   encode     reads the primitives, plan, table       writes keys[0], ends (none), the slots that no node will have;
//                                                      values[0] where nothing is sorted
//   (sort      reads keys[0]                           writes keys[result], values[result]: gpu/radix_sort.glsl)
//
// Where triangles are paired (bvh/pairs.glsl), bounds writes which are, the boxes of leaves, pair_count, and sums: pairs of each tile; plan
// makes of these those of all tiles before; encode reads all that, writes keys[0] and values[0] of pairs and of what is alone without a
// gap, and only those are sorted. Its tiles are those of bounds.
//
// needs one barrier between each two, and before the first; subgroups of any size; workgroups of whole subgroups
#ifndef HEDGEROW_BVH_ENCODE
#define HEDGEROW_BVH_ENCODE
#include "bvh/build_state.glsl"
#include "bvh/empty.glsl"
#include "bvh/pairs.glsl"
#include "bvh/sah.glsl"
#include "bvh/tiles.glsl"
#include "bvh/codes/sections.glsl"
#include "bvh/codes/mipping.glsl"
#include "bvh/codes/binning.glsl"

// The order of the phases in the pool; the radix sort's three steps a pass and those of the hierarchy follow.
const uint PHASE_FENCES = HAS_SECTIONS ? 0 : NONE;
const uint PHASE_BOUNDS = HAS_SECTIONS ? 1 : 0;
const uint PHASE_PLAN = PHASE_BOUNDS + 1;
const uint PHASE_CELLS = HAS_GRID ? PHASE_PLAN + 1 : NONE;
const uint PHASE_SPLITS = HAS_GRID ? PHASE_PLAN + 2 : NONE;
const uint PHASE_ENCODE = HAS_GRID ? PHASE_PLAN + 3 : PHASE_PLAN + 1;
const uint PHASES_BEFORE_SORT = PHASE_ENCODE + 1;
const uint PHASES_OF_A_PASS = 3;

// Phases of the pool before the first of the hierarchy.
uint phases_before_hierarchy() {
    return PHASES_BEFORE_SORT + PHASES_OF_A_PASS * passes;
}

// Columns of the sort's table.
uint columns_of_sort() {
    return (primitive_count + column_keys - 1) / column_keys;
}

// ---- reset ----

// `phases_behind`: phases behind the sort, of as many tasks as encode has, for the pool.
void reset_build(uint phases_behind) {
    BuildState state = build_state();
    uint i = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1) / tile;
    uint column_tasks = (columns_of_sort() + COLUMNS_A_TASK - 1) / COLUMNS_A_TASK;
    uint scan_tasks = (DIGITS + DIGITS_A_TASK - 1) / DIGITS_A_TASK;
    uint sorted = phases_before_hierarchy();
    uint phases = sorted + phases_behind;
    for (uint word = i; word < POOL_WORDS; word += gl_WorkGroupSize.x) {
        uint phase = word - POOL_WORD_TASKS;
        uint value = 0;
        if (word == POOL_WORD_PHASES) value = phases;
        if (word >= POOL_WORD_TASKS && phase < phases) {
            uint step = (phase - PHASES_BEFORE_SORT) % PHASES_OF_A_PASS;
            if (phase == PHASE_FENCES || phase == PHASE_PLAN || phase == PHASE_SPLITS) value = 1;
            else if (phase < PHASES_BEFORE_SORT || phase >= sorted) value = tiles;
            else value = step == 1 ? scan_tasks : column_tasks;
        }
        state.pool[word] = value;
    }
    for (uint axis = i; axis < 3; axis += gl_WorkGroupSize.x) {
        state.boxes_lo[axis] = NONE;
        state.boxes_hi[axis] = 0;
        state.centroids_lo[axis] = NONE;
        state.centroids_hi[axis] = 0;
        state.core_lo[axis] = NONE;
        state.core_hi[axis] = 0;
    }
    if (HAS_GRID) {
        Words cells = Words(part(parts.table));
        for (uint word = i; word < CELL_WORDS; word += gl_WorkGroupSize.x) cells.word[word] = 0;
    }
    if (i == 0) {
        state.active_count = 0;
        state.passes_left_out = 0;
        state.pair_count = 0;
        state.status = 0;
        if (phases_behind != 0) state.saved_parts = parts;
    }
}

// ---- bounds ----

// The words of BuildState from boxes_lo to status, or to core_hi in codes that have sections, of a workgroup: on a GPU hundreds of
// thousands of subgroups would wait for each other at one line of memory.
const uint CORE_WORD = 14;
const uint BOUNDS_WORDS = HAS_SECTIONS ? CORE_WORD + 6 : CORE_WORD;
shared uint group_bounds[PRIVATE_COUNTERS ? 1u : BOUNDS_WORDS];

bool is_low_corner(uint word) {
    return word < 12 ? word % 6 < 3 : word >= CORE_WORD && word < CORE_WORD + 3;
}

void begin_group_bounds() {
    for (uint i = gl_LocalInvocationIndex; i < BOUNDS_WORDS; i += gl_WorkGroupSize.x) {
        group_bounds[i] = is_low_corner(i) ? NONE : 0;
    }
    barrier();
}

// A lane a word.
void end_group_bounds(Words to) {
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < BOUNDS_WORDS; i += gl_WorkGroupSize.x) {
        uint found = group_bounds[i];
        if (is_low_corner(i)) atomicMin(to.word[i], found);
        else if (i < 12 || i >= CORE_WORD) atomicMax(to.word[i], found);
        else if (i == 12) atomicAdd(to.word[i], found);
        else if (found != 0) atomicOr(to.word[i], found);
    }
    barrier();   // the words may be used again by the next task
}

// Of what leaves hold: `ordered` corners of the box around it, around its centroids, and around what is inside the fences.
struct Found {
    uvec3 lo;
    uvec3 hi;
    uvec3 centroid_lo;
    uvec3 centroid_hi;
    uvec3 core_lo;
    uvec3 core_hi;
    uint active_count;
};

void find_box(inout Found found, Box b, Box fences) {
    uvec3 middle = ordered(centroid_of(b)), lo = ordered(b.lo), hi = ordered(b.hi);
    found.lo = min(found.lo, lo);
    found.hi = max(found.hi, hi);
    found.centroid_lo = min(found.centroid_lo, middle);
    found.centroid_hi = max(found.centroid_hi, middle);
    if (HAS_SECTIONS && is_inside(lo, hi, fences)) {
        found.core_lo = min(found.core_lo, lo);
        found.core_hi = max(found.core_hi, hi);
    }
    found.active_count += 1;
}

// Of a block that begins with this triangle: what the leaf with the one k behind it holds, if it is the first of one. Its box is kept.
void find_first(uint k, uint begin, inout Found found, Box fences) {
    bool is_first = (block_firsts & 1u << k) != 0u;
    if (is_first) find_box(found, block_box[k], fences);
    if (begin + k < primitive_count) keep_box(begin + k, block_box[k], is_first);
}

shared uint pairs_of_tile;

// Of pairs that an invocation has found: those of a tile and of all. Without subgroups, unlike `write_tile_sum`: by that, and all tiles' sums
// by `scan_tiles`, an NVIDIA H200 (driver 580.159.04) came to -8 pairs for 3 and for 389 (docs/notes/gpu.md).
void tell_pairs(uint task, uint pairs) {
    if (gl_LocalInvocationIndex == 0) pairs_of_tile = 0;
    barrier();
    if (pairs != 0) atomicAdd(pairs_of_tile, pairs);
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        sums_of_tiles().word[task] = pairs_of_tile;
        atomicAdd(build_state().pair_count, pairs_of_tile);
    }
}

// All leaves of a tile of blocks, in which pairs are found on the way; returns why triangles are left out.
uint find_pairs(uint task, inout Found found, Box fences) {
    Geometry input_geometries = geometries();
    uint status = 0, pairs = 0;
    uint begin = task * blocks_of_tile(), end = min(begin + blocks_of_tile(), (primitive_count + PAIR_BLOCK - 1) / PAIR_BLOCK);
    for (uint block = begin + gl_LocalInvocationIndex; block < end; block += gl_WorkGroupSize.x) {
        status |= load_block(input_geometries, block);
        blocks_of_pairs().word[block] = pair_block();
        pairs += bitCount(block_seconds);
        // No loop: see `pair_block`.
        uint first = block * PAIR_BLOCK;
        find_first(0, first, found, fences); find_first(1, first, found, fences); find_first(2, first, found, fences);
        find_first(3, first, found, fences); find_first(4, first, found, fences); find_first(5, first, found, fences);
        find_first(6, first, found, fences); find_first(7, first, found, fences);
    }
    tell_pairs(task, pairs);
    return status;
}

void find_bounds(uint task) {
    Geometry input_geometries = geometries();
    uvec3 most = uvec3(NONE), least = uvec3(0);
    Found found = Found(most, least, most, least, most, least, 0);
    Box fences;
    if (HAS_SECTIONS) fences = build_state().plan.sections.fences;
    uint status = 0;
    if (HAS_PAIRS) {
        status = find_pairs(task, found, fences);
    } else {
        uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
        for (uint k = 0; k < ITEMS; ++k) {
            uint primitive = first + k * gl_WorkGroupSize.x;
            if (primitive < primitive_count) {
                Box b;
                uint why_not = load_reference(input_geometries, primitive, b);
                status |= why_not;
                if (why_not == 0) find_box(found, b, fences);
            }
        }
    }
    uvec3 lo = found.lo, hi = found.hi, centroid_lo = found.centroid_lo, centroid_hi = found.centroid_hi;
    uvec3 core_lo = found.core_lo, core_hi = found.core_hi;
    uint active_count = found.active_count;
    lo = subgroupMin(lo);
    hi = subgroupMax(hi);
    centroid_lo = subgroupMin(centroid_lo);
    centroid_hi = subgroupMax(centroid_hi);
    if (HAS_SECTIONS) {
        core_lo = subgroupMin(core_lo);
        core_hi = subgroupMax(core_hi);
    }
    active_count = subgroupAdd(active_count);
    status = subgroupOr(status & ~INACTIVE);
    // Integers: the order in which the atomics arrive changes nothing.
    Words to = Words(address_of(scratch_address, POOL_WORDS, 4));
    if (!PRIVATE_COUNTERS) begin_group_bounds();
    if (subgroupElect()) {
        for (uint axis = 0; axis < 3; ++axis) {
            if (PRIVATE_COUNTERS) {
                atomicMin(to.word[axis], lo[axis]);
                atomicMax(to.word[3 + axis], hi[axis]);
                atomicMin(to.word[6 + axis], centroid_lo[axis]);
                atomicMax(to.word[9 + axis], centroid_hi[axis]);
                if (HAS_SECTIONS) {
                    atomicMin(to.word[CORE_WORD + axis], core_lo[axis]);
                    atomicMax(to.word[CORE_WORD + 3 + axis], core_hi[axis]);
                }
            } else {
                atomicMin(group_bounds[axis], lo[axis]);
                atomicMax(group_bounds[3 + axis], hi[axis]);
                atomicMin(group_bounds[6 + axis], centroid_lo[axis]);
                atomicMax(group_bounds[9 + axis], centroid_hi[axis]);
                if (HAS_SECTIONS) {
                    atomicMin(group_bounds[CORE_WORD + axis], core_lo[axis]);
                    atomicMax(group_bounds[CORE_WORD + 3 + axis], core_hi[axis]);
                }
            }
        }
        if (PRIVATE_COUNTERS) {
            atomicAdd(to.word[12], active_count);
            if (status != 0) atomicOr(to.word[13], status);
        } else {
            atomicAdd(group_bounds[12], active_count);
            atomicOr(group_bounds[13], status);
        }
    }
    if (!PRIVATE_COUNTERS) end_group_bounds(to);
}

// ---- plan ----

// By one invocation, but for what the recipe says.
void write_header(BuildState state, uint slots, uint geometry_count, uint geometry_flags) {
    Structure structure = Structure(structure_address);
    structure.header.magic = MAGIC;
    structure.header.kind = kind_of_records();
    structure.header.status = state.status;
    structure.header.primitive_count = primitive_count;
    structure.header.root = empty_root();
    structure.header.active_count = state.active_count + pairs_in_all();
    structure.header.node_slots = slots;
    structure.header.code_bits = given_code_bits();
    structure.header.inner_nodes = max(state.active_count, 1) - 1;
    structure.header.geometry_count = geometry_count;
    structure.header.geometry_flags = geometry_flags;
    structure.header.build_flags = build_flags;
    structure.header.area_scale = 0.0;
    structure.header.cost = 0.0;
    structure.header.built_cost = 0.0;
    structure.header.built_area = 0.0;
    structure.header.split_from = HAS_REFERENCES ? SplitState(part(parts.split)).primitive_count : 0;
    structure.header.child_order = 0;
    structure.header.pairs = 0;
    structure.header.near_node = 0;
    structure.header.far_sides = 0;
    for (uint i = 0; i < 4; ++i) structure.header.reserved[i] = 0;
    // With pairs, boxes lie there now: bvh/collapse.glsl marks it.
    if (!HAS_PAIRS && primitive_count < 2) mark_unused(structure, 0);
}

// Of bounds that hold something: an axis a lane, the others by one.
void write_recipe(BuildState state, Box boxes, Box bounds) {
    for (uint axis = gl_LocalInvocationIndex; axis < 3; axis += gl_WorkGroupSize.x) {
        state.plan.axes[axis] = axis_of(bounds.lo[axis], bounds.hi[axis]);
    }
    if (gl_LocalInvocationIndex != 0) return;
    CodeKind kind = kind_of_codes();
    bool has_core = HAS_SECTIONS && state.plan.sections.head != 0;
    Structure structure = Structure(structure_address);
    uint most = most_bits_by_spread();
    if (most != 0) {
        kind.bits = bits_by_spread(kind, extents_of(bounds), state.plan.typical, has_core, most);
        state.plan.bits = kind.bits;
        state.passes_left_out = passes - min((kind.bits + DIGIT_BITS - 1) / DIGIT_BITS, passes);
        structure.header.code_bits = kind.bits;
    }
    CodePlan plan = plan_codes(kind, bounds);
    plan.area_scale = area_scale_for(boxes, has_core ? bounds : boxes);
    if (HAS_SECTIONS) {
        state.where_most_is = EVERYWHERE;
        if (has_core) state.where_most_is = bounds;
    }
    state.plan.size_prescale = plan.size_prescale;
    state.plan.size_reciprocal = plan.size_reciprocal;
    if (BY_EXTENTS) state.plan.size_least = plan.size_least;
    state.plan.area_scale = plan.area_scale;
    state.plan.stretches = plan.stretches;
    if (HAS_GRID) state.plan.grid = plan.grid;
    if (has_core) state.plan.sections.head = far_is_apart() ? HEAD_APART : head_of(plan.stretches);
    structure.header.area_scale = plan.area_scale;
    structure.header.built_area = scaled_half_area(boxes, plan.area_scale);
}

// By the workgroup together.
void make_plan() {
    BuildState state = build_state();
    if (HAS_PAIRS) scan_tiles(tiles_of(primitive_count));
    uint geometry_count = count_geometries(geometries()), slots = slots_of(HAS_PAIRS ? state.active_count : primitive_count);
    uint bytes_each = HAS_NUMBERS ? 4u : record_bytes(kind_of_records());
    GeometryTable table = GeometryTable(address_of(records_at(structure_address, slots_before_records(slots)), primitive_count, bytes_each));
    uint geometry_flags = write_geometries_together(geometries(), geometry_count, table);
    if (gl_LocalInvocationIndex == 0) write_header(state, slots, geometry_count, geometry_flags);
    if (HAS_SECTIONS) {
        find_sections();
        next_phase();
    }
    if (state.active_count == 0) return;
    Box boxes = bounds_of_boxes(state);
    Box centroids = Box(from_ordered(uvec3(state.centroids_lo[0], state.centroids_lo[1], state.centroids_lo[2])),
                        from_ordered(uvec3(state.centroids_hi[0], state.centroids_hi[1], state.centroids_hi[2])));
    Box bounds = code_bounds(boxes, centroids, kind_of_codes().bounds);
    if (HAS_SECTIONS && state.plan.sections.head != 0) bounds = state.plan.sections.core;
    if (HAS_SECTIONS) barrier();   // the head is about to change
    write_recipe(state, boxes, bounds);
}

// ---- what the cells of a grid say; one workgroup ----

void find_prefixes() {
    if (CODE_PREFIX == PREFIX_CELLS) find_layers();
    else find_splits();
}

// ---- encode ----

CodeParts parts_of(CodeKind kind, CodePlan plan, Box b) {
    if (CODE_PREFIX == PREFIX_SECTIONS) return section_parts(kind, plan, b);
    if (CODE_PREFIX == PREFIX_CELLS) return mip_parts(kind, plan, b);
    if (CODE_PREFIX == PREFIX_SPLITS) return bin_parts(kind, plan, b);
    return plain_parts(kind, plan, b);
}

// The code of a primitive: not that of those that are left out.
uvec2 code_of(CodeKind kind, CodePlan plan, Box b) {
    CodeParts parts = parts_of(kind, plan, b);
    uvec2 code = KEY_WORDS == 1 ? uvec2(narrow_body(kind, parts), 0) : wide_body(kind, parts);
    if (HAS_SECTIONS) code = with_section(kind, plan, parts, code);
    if (HAS_GRID && parts.prefix_bits != 0) {
        code = shift_right(code, parts.prefix_bits) | shift_left(uvec2(parts.prefix, 0), kind.bits - parts.prefix_bits);
    }
    if (code == inactive_code(kind)) code.x -= 1;
    return code;
}

// What is encoded, and where to.
struct Encoder {
    Geometry input_geometries;
    CodeKind kind;
    CodePlan plan;
    uint active_count;
    Words keys;
    Words values;
};

// What goes to the place `at` of those that are sorted.
void encode_reference(Encoder to, uint primitive, uint at) {
    Box b;
    bool is_active = load_reference(to.input_geometries, primitive, b) == 0;
    uvec2 code = is_active ? code_of(to.kind, to.plan, b) : inactive_code(to.kind);
    if (KEY_WORDS == 1) {
        to.keys.word[at] = code.x;
    } else {
        to.keys.word[2 * at] = code.x;
        to.keys.word[2 * at + 1] = code.y;
    }
    if (HAS_PAIRS || passes == 0) to.values.word[at] = primitive;
    Words(part(parts.ends)).word[at] = NONE;
    // Slots from active_count - 1 on have no node.
    if (!HAS_PAIRS && at >= max(to.active_count, 1)) mark_unused(Structure(structure_address), at - 1);
}

// A tile of blocks: pairs and what is alone, side by side.
void encode_pairs(uint task, Encoder to) {
    uint before = sums_of_tiles().word[task];
    for (uint first = 0; first < blocks_of_tile(); first += gl_WorkGroupSize.x) {
        uint i = first + gl_LocalInvocationIndex, begin = (task * blocks_of_tile() + i) * PAIR_BLOCK;
        uint end = i < blocks_of_tile() ? min(begin + PAIR_BLOCK, primitive_count) : 0u;
        uint seconds = begin < end ? seconds_of_block(blocks_of_pairs().word[begin / PAIR_BLOCK]) : 0u;
        uint total;
        uint at = begin - (before + sum_before(bitCount(seconds), total));
        before += total;
        uint left = begin < end ? (1u << end - begin) - 1u & ~seconds : 0u;
        // `begin` goes on with the loop: as it was, LLVM found the invocation's number in each turn anew, by eight divisions.
        for (uint k = 0; k < PAIR_BLOCK && left != 0u; ++k) {
            uint next = findLSB(left);
            begin += next;
            encode_reference(to, begin, at++);
            left = left >> next & ~1u;
        }
    }
}

void encode(uint task) {
    BuildState state = build_state();
    uint from = passes_left_out() & 1u;
    Encoder to = Encoder(geometries(), kind_of_codes(), state.plan, state.active_count, Words(part(parts.keys[from])),
                         Words(part(parts.values[from])));
    if (HAS_PAIRS) {
        encode_pairs(task, to);
        return;
    }
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint primitive = first + k * gl_WorkGroupSize.x;
        if (primitive < primitive_count) encode_reference(to, primitive, primitive);
    }
}

// ---- sort ----

// Of a pass that is not left out.
Radix radix_of_pass(uint pass) {
    uint from = pass & 1, done = pass - passes_left_out(), count = primitive_count - pairs_in_all();
    return Radix(Words(part(parts.keys[from])), Words(part(parts.values[from])), Words(part(parts.keys[1 - from])),
                 Words(part(parts.values[1 - from])), Words(part(parts.table)), count, done * DIGIT_BITS, columns_of_sort(),
                 keys_of_column(count, columns_of_sort(), column_keys),
                 !HAS_PAIRS && done == 0);
}

// ---- from the task pool ----

// A task of one of the phases before the hierarchy.
void encode_from_pool(uint phase, uint task) {
    if (HAS_SECTIONS && phase == PHASE_FENCES) {
        find_fences();
    } else if (phase == PHASE_BOUNDS) {
        find_bounds(task);
    } else if (phase == PHASE_PLAN) {
        make_plan();
    } else if (HAS_GRID && phase == PHASE_CELLS) {
        count_cells(task);
    } else if (HAS_GRID && phase == PHASE_SPLITS) {
        find_prefixes();
    } else if (phase == PHASE_ENCODE) {
        encode(task);
    } else {
        uint pass = (phase - PHASES_BEFORE_SORT) / PHASES_OF_A_PASS;
        if (pass < passes_left_out()) return;
        Radix r = radix_of_pass(pass);
        uint step = (phase - PHASES_BEFORE_SORT) % PHASES_OF_A_PASS;
        if (step == 0) radix_count(r, task);
        else if (step == 1) radix_scan(r, task);
        else radix_scatter(r, task);
    }
}
#endif
