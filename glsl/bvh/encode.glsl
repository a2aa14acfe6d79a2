// From primitives to an order: the phases that every builder begins with, each a function over a task (a workgroup's worth of
// items): dispatched one by one (bvh/encode_*.comp, gpu/radix_sort_*.comp) or from the task pool by the builder's persistent
// kernel. src/bvh/encode.rs records them; a hierarchy follows.
//
//   reset      writes state: empty bounds, the pool
//   bounds     reads the primitives                    writes state: bounds, active_count, status
//   plan       reads state: bounds                     writes state: plan; the structure's header and table of geometries
//   encode     reads the primitives, plan              writes keys[0], ends (none), the slots that no node will have;
//                                                      values[0] where nothing is sorted
//   (sort      reads keys[0]                           writes keys[result], values[result]: gpu/radix_sort.glsl)
//
// needs one barrier between each two, and before the first; subgroups of any size; workgroups of whole subgroups
#ifndef HEDGEROW_BVH_ENCODE
#define HEDGEROW_BVH_ENCODE
#include "gpu/pass.glsl"
#include "gpu/task_pool.glsl"
#include "gpu/radix_sort.glsl"
#include "bvh/layout.glsl"
#include "bvh/empty.glsl"
#include "bvh/primitives.glsl"
#include "bvh/codes.glsl"
#include "bvh/sah.glsl"

// Items of an invocation in a task.
layout(constant_id = 1) const uint ITEMS = 1;

const uint NONE = 0xFFFFFFFFu;

// The order of the phases in the pool; the radix sort's three steps a pass and those of the hierarchy follow.
const uint PHASE_BOUNDS = 0;
const uint PHASE_PLAN = 1;
const uint PHASE_ENCODE = 2;
const uint PHASES_BEFORE_SORT = 3;
const uint PHASES_OF_A_PASS = 3;

BUFFER BuildState {
    uint pool[4 + POOL_PHASES_AT_MOST];   // a PoolState
    uint boxes_lo[3];                     // `ordered` floats
    uint boxes_hi[3];
    uint centroids_lo[3];
    uint centroids_hi[3];
    uint active_count;
    uint status;
    CodePlan plan;
    uint cluster_counts[2];               // of PLOC: of even and odd rounds; of HLBVH the first: treelets
    uint is_forced[2];
};

// What a build is given: the push constants, or variables that the shader sets first. `vertices` to `transform` with
// `vertex_stride` to `formats` are a Geometry; `code_kind` is order, bits << 8, size group << 16, concise << 24, collapse << 25,
// build flags << 26;
// `columns` to `passes` are of the radix sort; where it has run, `columns` is the level of bvh/hlbvh_split.comp and
// hlbvh_finish.comp.
#define BUILD_ARGUMENTS                                                                                        \
    uvec2 vertices; uvec2 indices; uvec2 transform; uvec2 structure_address; uvec2 state_address;             \
    uvec2 keys[2]; uvec2 values[2]; uvec2 ends_address; uvec2 table_address;                                  \
    uint vertex_stride; uint vertex_count; uint formats; uint primitive_count; uint code_kind;                \
    float c_t; float c_i;                                                                                     \
    uint columns; uint column_keys; uint passes;
#ifdef HEDGEROW_BUILD_ARGUMENTS_ARE_SET
BUILD_ARGUMENTS
#else
layout(push_constant, scalar) uniform Arguments { BUILD_ARGUMENTS };
#endif

Geometry geometries() {
    return Geometry(vertices, indices, transform, vertex_stride, vertex_count, formats, 0);
}

CodeKind kind_of_codes() {
    return CodeKind(code_kind & 0xFFu, code_kind >> 8 & 0xFFu, code_kind >> 16 & 0xFFu, (code_kind >> 24 & 1) != 0);
}

bool collapses() {
    return (code_kind >> 25 & 1) != 0;
}

// Phases of the pool before the first of the hierarchy.
uint phases_before_hierarchy() {
    return PHASES_BEFORE_SORT + PHASES_OF_A_PASS * passes;
}

// ---- reset ----

// `phases_behind`: phases behind the sort, of as many tasks as encode has, for the pool.
void reset_build(uint phases_behind) {
    BuildState state = BuildState(state_address);
    uint i = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1) / tile;
    uint columns_a_task = PRIVATE_COUNTERS ? gl_WorkGroupSize.x : 1;
    uint column_tasks = (columns + columns_a_task - 1) / columns_a_task;
    uint scan_tasks = (DIGITS + columns_a_task - 1) / columns_a_task;
    uint sorted = phases_before_hierarchy();
    uint phases = sorted + phases_behind;
    for (uint word = i; word < 4 + POOL_PHASES_AT_MOST; word += gl_WorkGroupSize.x) {
        uint phase = word - 4;
        uint value = 0;
        if (word == 3) value = phases;
        if (word >= 4 && phase < phases) {
            uint step = (phase - PHASES_BEFORE_SORT) % PHASES_OF_A_PASS;
            if (phase == PHASE_PLAN) value = 1;
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
    }
    if (i == 0) {
        state.active_count = 0;
        state.status = 0;
    }
}

// ---- bounds ----

void find_bounds(uint task) {
    BuildState state = BuildState(state_address);
    Geometry input_geometries = geometries();
    uvec3 lo = uvec3(NONE), hi = uvec3(0), centroid_lo = uvec3(NONE), centroid_hi = uvec3(0);
    uint active_count = 0, status = 0;
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint primitive = first + k * gl_WorkGroupSize.x;
        if (primitive < primitive_count) {
            Box b;
            uint why_not = load_box(input_geometries, primitive, b);
            status |= why_not;
            if (why_not == 0) {
                uvec3 middle = ordered(centroid_of(b));
                lo = min(lo, ordered(b.lo));
                hi = max(hi, ordered(b.hi));
                centroid_lo = min(centroid_lo, middle);
                centroid_hi = max(centroid_hi, middle);
                active_count += 1;
            }
        }
    }
    lo = subgroupMin(lo);
    hi = subgroupMax(hi);
    centroid_lo = subgroupMin(centroid_lo);
    centroid_hi = subgroupMax(centroid_hi);
    active_count = subgroupAdd(active_count);
    status = subgroupOr(status);
    // Integers: the order in which the atomics arrive changes nothing.
    if (subgroupElect()) {
        for (uint axis = 0; axis < 3; ++axis) {
            atomicMin(state.boxes_lo[axis], lo[axis]);
            atomicMax(state.boxes_hi[axis], hi[axis]);
            atomicMin(state.centroids_lo[axis], centroid_lo[axis]);
            atomicMax(state.centroids_hi[axis], centroid_hi[axis]);
        }
        atomicAdd(state.active_count, active_count);
        if ((status & ~INACTIVE) != 0) atomicOr(state.status, status & ~INACTIVE);
    }
}

// ---- plan ----

// The flags of all geometries in one word; where there are several, the structure's table is written.
uint write_geometries(Geometry g, uint count, uint node_slots) {
    if (!has_records()) return SOURCE == SOURCE_ENTRIES ? 0 : flags_of(g) | flags_of(g) << 8;
    Geometries given = Geometries(g.vertices);
    GeometryTable table = geometry_table_at(structure_address, kind_of_records(), node_slots, primitive_count);
    uint all = 0xFF, any = 0;
    for (uint i = 0; i < count; ++i) {
        uint flags = flags_of(given.geometry[i]);
        if (count > 1) table.entry[i] = GeometryEntry(given.geometry[i].first, flags);
        all &= flags;
        any |= flags;
    }
    return all | any << 8;
}

void make_plan() {
    if (gl_LocalInvocationIndex != 0) return;
    BuildState state = BuildState(state_address);
    Structure structure = Structure(structure_address);
    uint slots = max(primitive_count, 2) - 1;
    uint bits = kind_of_codes().bits;
    structure.header.magic = MAGIC;
    structure.header.kind = kind_of_records();
    structure.header.status = state.status;
    structure.header.primitive_count = primitive_count;
    structure.header.root = empty_root();
    structure.header.active_count = state.active_count;
    structure.header.node_slots = slots;
    structure.header.code_bits = bits;
    structure.header.inner_nodes = max(state.active_count, 1) - 1;
    uint geometry_count = count_geometries(geometries());
    structure.header.geometry_count = geometry_count;
    structure.header.geometry_flags = write_geometries(geometries(), geometry_count, slots);
    structure.header.build_flags = code_kind >> 26;
    structure.header.area_scale = 0.0;
    structure.header.cost = 0.0;
    structure.header.built_cost = 0.0;
    structure.header.built_area = 0.0;
    for (uint i = 0; i < 9; ++i) structure.header.reserved[i] = 0;
    if (primitive_count < 2) mark_unused(structure, 0);
    if (state.active_count == 0) return;
    Box boxes = Box(from_ordered(uvec3(state.boxes_lo[0], state.boxes_lo[1], state.boxes_lo[2])),
                    from_ordered(uvec3(state.boxes_hi[0], state.boxes_hi[1], state.boxes_hi[2])));
    Box centroids = Box(from_ordered(uvec3(state.centroids_lo[0], state.centroids_lo[1], state.centroids_lo[2])),
                        from_ordered(uvec3(state.centroids_hi[0], state.centroids_hi[1], state.centroids_hi[2])));
    CodeKind kind = kind_of_codes();
    state.plan = plan_codes(kind, code_bounds(boxes, centroids, kind.concise), boxes);
    structure.header.area_scale = state.plan.area_scale;
    structure.header.built_area = scaled_half_area(boxes, state.plan.area_scale);
}

// ---- encode ----

void encode(uint task) {
    BuildState state = BuildState(state_address);
    Geometry input_geometries = geometries();
    CodeKind kind = kind_of_codes();
    CodePlan plan = state.plan;
    Words codes = Words(keys[0]);
    Words ends = Words(ends_address);
    uint first = task * gl_WorkGroupSize.x * ITEMS + gl_LocalInvocationIndex;
    for (uint k = 0; k < ITEMS; ++k) {
        uint primitive = first + k * gl_WorkGroupSize.x;
        if (primitive < primitive_count) {
            Box b;
            bool is_active = load_box(input_geometries, primitive, b) == 0;
            if (KEY_WORDS == 1) {
                codes.word[primitive] = is_active ? narrow_encode(kind, plan, b) : inactive_code(kind).x;
            } else {
                uvec2 code = is_active ? wide_encode(kind, plan, b) : inactive_code(kind);
                codes.word[2 * primitive] = code.x;
                codes.word[2 * primitive + 1] = code.y;
            }
            ends.word[primitive] = NONE;
            // Slots from active_count - 1 on have no node.
            if (primitive >= max(state.active_count, 1)) mark_unused(Structure(structure_address), primitive - 1);
            if (passes == 0) Words(values[0]).word[primitive] = primitive;
        }
    }
}

// ---- sort ----

Radix radix_of_pass(uint pass) {
    uint from = pass & 1;
    return Radix(Words(keys[from]), Words(values[from]), Words(keys[1 - from]), Words(values[1 - from]),
                 Words(table_address), primitive_count, pass * DIGIT_BITS, columns, column_keys, pass == 0);
}

// ---- from the task pool ----

// A task of one of the phases before the hierarchy.
void encode_from_pool(uint phase, uint task) {
    if (phase == PHASE_BOUNDS) {
        find_bounds(task);
    } else if (phase == PHASE_PLAN) {
        make_plan();
    } else if (phase == PHASE_ENCODE) {
        encode(task);
    } else {
        Radix r = radix_of_pass((phase - PHASES_BEFORE_SORT) / PHASES_OF_A_PASS);
        uint step = (phase - PHASES_BEFORE_SORT) % PHASES_OF_A_PASS;
        if (step == 0) radix_count(r, task);
        else if (step == 1) radix_scan(r, task);
        else radix_scatter(r, task);
    }
}
#endif
