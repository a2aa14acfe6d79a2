// The phases of the LBVH build, each a function over a task (a workgroup's worth of items): dispatched one by one
// (bvh/lbvh_*.comp) or all from the task pool (bvh/lbvh_persistent.comp). src/bvh/lbvh.rs records both.
//
//   bounds     reads the primitives                    writes state: bounds, active_count, status
//   plan       reads state: bounds                     writes state: plan; the structure's header and table of geometries
//   encode     reads the primitives, plan              writes keys[0], ends (none); values[0] where nothing is sorted
//   (sort      reads keys[0]                           writes keys[result], values[result]: gpu/radix_sort.glsl)
//   hierarchy  reads the primitives, keys and values   writes the structure: records, nodes, root, costs
//
// needs one barrier between each two, and before the first; subgroups of any size; workgroups of whole subgroups
#ifndef HEDGEROW_BVH_LBVH
#define HEDGEROW_BVH_LBVH
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

// The order of the phases in the pool; the radix sort's three steps a pass and the hierarchy follow.
const uint PHASE_BOUNDS = 0;
const uint PHASE_PLAN = 1;
const uint PHASE_ENCODE = 2;
const uint PHASES_BEFORE_SORT = 3;
const uint PHASES_OF_A_PASS = 3;

BUFFER LbvhState {
    uint pool[4 + POOL_PHASES_AT_MOST];   // a PoolState
    uint boxes_lo[3];                     // `ordered` floats
    uint boxes_hi[3];
    uint centroids_lo[3];
    uint centroids_hi[3];
    uint active_count;
    uint status;
    CodePlan plan;
};

// What a build is given: the push constants, or variables that the shader sets first. `vertices` to `transform` with
// `vertex_stride` to `formats` are a Geometry; `code_kind` is order, bits << 8, size group << 16, concise << 24, collapse << 25,
// build flags << 26;
// `columns` to `passes` are of the radix sort.
#define LBVH_ARGUMENTS                                                                                        \
    uvec2 vertices; uvec2 indices; uvec2 transform; uvec2 structure_address; uvec2 state_address;             \
    uvec2 keys[2]; uvec2 values[2]; uvec2 ends_address; uvec2 table_address;                                  \
    uint vertex_stride; uint vertex_count; uint formats; uint primitive_count; uint code_kind;                \
    float c_t; float c_i;                                                                                     \
    uint columns; uint column_keys; uint passes;
#ifdef HEDGEROW_LBVH_ARGUMENTS_ARE_SET
LBVH_ARGUMENTS
#else
layout(push_constant, scalar) uniform Arguments { LBVH_ARGUMENTS };
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

// ---- reset: writes the state that the others begin with ----

void lbvh_reset() {
    LbvhState state = LbvhState(state_address);
    uint i = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1) / tile;
    uint columns_a_task = PRIVATE_COUNTERS ? gl_WorkGroupSize.x : 1;
    uint column_tasks = (columns + columns_a_task - 1) / columns_a_task;
    uint scan_tasks = (DIGITS + columns_a_task - 1) / columns_a_task;
    uint phases = PHASES_BEFORE_SORT + PHASES_OF_A_PASS * passes + 1;
    for (uint word = i; word < 4 + POOL_PHASES_AT_MOST; word += gl_WorkGroupSize.x) {
        uint phase = word - 4;
        uint value = 0;
        if (word == 3) value = phases;
        if (word >= 4 && phase < phases) {
            uint step = (phase - PHASES_BEFORE_SORT) % PHASES_OF_A_PASS;
            if (phase == PHASE_PLAN) value = 1;
            else if (phase < PHASES_BEFORE_SORT || phase == phases - 1) value = tiles;
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

void lbvh_bounds(uint task) {
    LbvhState state = LbvhState(state_address);
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

void lbvh_plan() {
    if (gl_LocalInvocationIndex != 0) return;
    LbvhState state = LbvhState(state_address);
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

void lbvh_encode(uint task) {
    LbvhState state = LbvhState(state_address);
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
            if (passes == 0) Words(values[0]).word[primitive] = primitive;
        }
    }
}

// ---- sort ----

Radix lbvh_radix(uint pass) {
    uint from = pass & 1;
    return Radix(Words(keys[from]), Words(values[from]), Words(keys[1 - from]), Words(values[1 - from]),
                 Words(table_address), primitive_count, pass * DIGIT_BITS, columns, column_keys, pass == 0);
}

// ---- hierarchy ----

// How the codes at positions i and i + 1 differ, as a number that is larger where a higher bit differs: the code's bits, then
// those of the position, which tell equal codes apart.
uvec3 difference_at(Words codes, uint i) {
    if (KEY_WORDS == 1) return uvec3(i ^ (i + 1), codes.word[i] ^ codes.word[i + 1], 0);
    return uvec3(i ^ (i + 1), codes.word[2 * i] ^ codes.word[2 * i + 2], codes.word[2 * i + 1] ^ codes.word[2 * i + 3]);
}

// Of the neighbouring splits of a subtree; at the ends of all positions there is none.
uvec3 difference_before(Words codes, uint first) {
    return first > 0 ? difference_at(codes, first - 1) : uvec3(NONE);
}

uvec3 difference_behind(Words codes, uint last, uint active_count) {
    return last + 1 < active_count ? difference_at(codes, last) : uvec3(NONE);
}

bool is_less(uvec3 a, uvec3 b) {
    if (KEY_WORDS == 2 && a.z != b.z) return a.z < b.z;
    return a.y != b.y ? a.y < b.y : a.x < b.x;
}

// A finished subtree over the positions first..=last, and how the codes differ before and behind it.
struct Subtree {
    uint first;
    uint last;
    uvec3 before;
    uvec3 behind;
    Child child;
    float cost;
};

// Left children that wait for a sibling out of the same run of positions: where each begins. They lie side by side and end
// with the run so far, so that the last of them is the sibling of whichever right child comes next.
shared uint run_firsts[ITEMS * gl_WorkGroupSize.x];

uint run_slot(uint level) {
    return level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

// Marks the slots below a leaf over the positions first..=last; how many had a node of the tree.
uint free_slots(Structure structure, uint first, uint last) {
    uint freed = 0;
    for (uint slot = first; slot < last; ++slot) {
        if (structure.nodes[slot].left.count != UNUSED) {
            structure.nodes[slot].left.count = UNUSED;
            freed += 1;
        }
    }
    return freed;
}

// From a subtree up (Apetrei 2014): of two siblings the second to arrive goes on with their parent. The node that splits
// between positions i and i + 1 has slot i, so its parent follows from which of the two neighbouring splits differs in a lower
// bit. An invocation that has a run of positions meets most siblings itself and asks the others only at the run's two ends:
// atomics and their fences were a third of the time.
void climb(Structure structure, Words codes, uint active_count, float area_scale, uint run, inout uint waiting,
           inout uint unused, Subtree s) {
    Words ends = Words(ends_address);
    // The buffers that the sort has left free hold the costs of left and right children.
    uint is_free = 1 - (passes & 1);
    Floats left_costs = Floats(keys[is_free]);
    Floats right_costs = Floats(values[is_free]);
    // A level a differing bit: codes have 64 at most, positions 27.
    for (uint level = 0; level <= MAX_DEPTH; ++level) {
        if (s.first == 0 && s.last + 1 == active_count) {
            structure.header.root = s.child;
            structure.header.cost = s.cost;
            structure.header.built_cost = s.cost;
            break;
        }
        bool is_left = is_less(s.behind, s.before);
        uint parent = is_left ? s.last : s.first - 1;
        if (is_left) {
            structure.nodes[parent].left = s.child;
            left_costs.value[parent] = s.cost;
        } else {
            structure.nodes[parent].right = s.child;
            right_costs.value[parent] = s.cost;
        }
        uint end;
        if (is_left && s.first >= run) {
            run_firsts[run_slot(waiting)] = s.first;
            waiting++;
            break;
        }
        if (!is_left && waiting > 0) {
            waiting--;
            end = run_firsts[run_slot(waiting)];
        } else {
            release_to_device();
            end = atomicExchange(ends.word[parent], is_left ? s.first : s.last);
            if (end == NONE) break;
            acquire_from_device();
        }
        Child sibling;
        float sibling_cost;
        if (is_left) {
            s.last = end;
            s.behind = difference_behind(codes, s.last, active_count);
            sibling = structure.nodes[parent].right;
            sibling_cost = right_costs.value[parent];
        } else {
            s.first = end;
            s.before = difference_before(codes, s.first);
            sibling = structure.nodes[parent].left;
            sibling_cost = left_costs.value[parent];
        }
        s.child.lo = min(s.child.lo, sibling.lo);
        s.child.hi = max(s.child.hi, sibling.hi);
        uint count = s.last - s.first + 1;
        float area = scaled_half_area(Box(s.child.lo, s.child.hi), area_scale);
        float as_leaf = leaf_cost(c_i, area, count);
        s.cost = inner_cost(c_t, area, s.cost, sibling_cost);
        bool as_leaf_is_cheaper = collapses() && as_leaf < s.cost;
        s.child.index = as_leaf_is_cheaper ? s.first : parent;
        s.child.count = as_leaf_is_cheaper ? count : 0;
        if (as_leaf_is_cheaper) {
            s.cost = as_leaf;
            unused += free_slots(structure, s.first, s.last);
        }
    }
}

void lbvh_hierarchy(uint task) {
    LbvhState state = LbvhState(state_address);
    Structure structure = Structure(structure_address);
    uvec2 records = records_at(structure_address, max(primitive_count, 2) - 1);
    Geometry input_geometries = geometries();
    uint active_count = state.active_count;
    float area_scale = state.plan.area_scale;
    uint is_free = 1 - (passes & 1);
    Words codes = Words(keys[passes & 1]);
    Words order = Words(values[passes & 1]);
    uint run = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * ITEMS;
    uint end = min(run + ITEMS, primitive_count);
    uint position = run;
    uint waiting = 0;
    uint unused = 0;
    // First the leaves of the run; then what waits, last first: its siblings begin behind the run.
    bool leaves_done = false;
    while (true) {
        Subtree s;
        uint own_run = run;
        bool climbs = true;
        if (position < end) {
            Box b;
            write_record(records, position, input_geometries, order.word[position], b);
            climbs = position < active_count;
            // Slots from active_count - 1 on have no node.
            if (position >= max(active_count, 1)) mark_unused(structure, position - 1);
            s.first = position;
            s.last = position;
            s.child = Child(b.lo, position, b.hi, 1);
            s.cost = leaf_cost(c_i, scaled_half_area(b, area_scale), 1);
            position++;
        } else if (waiting > 0) {
            own_run = NONE;
            // What was taken last began where this ends.
            s.last = (leaves_done ? run_firsts[run_slot(waiting)] : min(end, active_count)) - 1;
            leaves_done = true;
            waiting--;
            s.first = run_firsts[run_slot(waiting)];
            s.child = structure.nodes[s.last].left;
            s.cost = Floats(keys[is_free]).value[s.last];
        } else {
            break;
        }
        if (climbs) {
            s.before = difference_before(codes, s.first);
            s.behind = difference_behind(codes, s.last, active_count);
            climb(structure, codes, active_count, area_scale, own_run, waiting, unused, s);
        }
    }
    unused = subgroupAdd(unused);
    if (unused > 0 && subgroupElect()) atomicAdd(structure.header.inner_nodes, -unused);
}
#endif
