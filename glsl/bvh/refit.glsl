// The phases of a refit, each a function over a task (a workgroup's worth of runs of slots): dispatched one by one
// (bvh/refit/*.comp) or all by one workgroup (bvh/refit/workgroup.comp). src/bvh/refit.rs records both.
//
//   leaves   reads the primitives, the nodes        writes the structure: records, status, boxes of leaves and of what lies in
//                                                   one run; scratch: all
//   climb    reads nodes, scratch                   writes the structure: the other boxes, root, cost; scratch: ways, costs
//
// Which node has which children and records, and in which order they lie, stays. A structure of another kind, larger than was
// planned for or with split triangles is left as it is.
//
// needs one barrier between the two, and before the first; subgroups of any size; workgroups of whole subgroups
#ifndef HEDGEROW_BVH_REFIT
#define HEDGEROW_BVH_REFIT
#include "gpu/pass.glsl"
#include "bvh/layout.glsl"
#include "bvh/primitives.glsl"
#include "bvh/sah.glsl"

// Slots of a run, which one invocation has in a task: at most 32, for masks hold a bit for each.
layout(constant_id = 1) const uint RUN = 1;

const uint NONE = 0xFFFFFFFFu;
// Records from which on a leaf is shared by the lanes of a subgroup.
const uint LARGE = 32;

// The way up from a slot: the child that names it, by its number among all children, 2 · slot + side.
const uint CHILD = (1u << 29) - 1u;
const uint HAS_INNER_SIBLING = 1u << 29;
const uint IS_ROOT = 1u << 30;
// In the way of a slot with two inner children: one of them is done.
const uint ARRIVED = 1u << 31;

// The twin of `Update` in src/bvh/refit.rs: a Geometry, memory, and how many primitives the structure was built over.
struct Update {
    uvec2 vertices;
    uvec2 indices;
    uvec2 transform;
    uvec2 structure;
    uvec2 scratch;
    uint vertex_stride;
    uint vertex_count;
    uint formats;
    uint primitive_count;
};

layout(push_constant, scalar) uniform RefitArguments {
    Update updates[2];
    float c_t;
    float c_i;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) nonprivate buffer Children { Child child[]; };

// What an update is worked on with.
struct Work {
    Geometry geometry;
    uint primitive_count;
    Structure structure;
    Children children;    // 2 · slot + side
    uvec2 records;
    uint slots;
    uint record_count;
    float area_scale;
    Words ways;           // for each slot
    Floats costs;         // for each slot: of the subtree
    Words starts;         // for each run: the slots that are done, and whose parents are elsewhere
    Words waiting;        // for each run: the slots of whose two inner children one is done
};

// False for a structure that is not what was planned for.
bool begin(Update u, out Work w) {
    uint slots_at_most = max(u.primitive_count, 2u) - 1u;
    Structure structure = Structure(u.structure);
    w.geometry = Geometry(u.vertices, u.indices, u.transform, u.vertex_stride, u.vertex_count, u.formats, 0);
    w.primitive_count = u.primitive_count;
    w.structure = structure;
    w.children = Children(records_at(u.structure, 0));
    w.slots = structure.header.node_slots;
    w.records = records_at(u.structure, w.slots);
    w.record_count = min(structure.header.active_count, structure.header.primitive_count);
    w.area_scale = structure.header.area_scale;
    w.ways = Words(u.scratch);
    w.costs = Floats(address_of(u.scratch, slots_at_most, 4u));
    w.starts = Words(address_of(u.scratch, slots_at_most, 8u));
    w.waiting = Words(address_of(uvec2(w.starts), (slots_at_most + RUN - 1u) / RUN, 4u));
    return structure.header.magic == MAGIC && structure.header.kind == kind_of_records() && w.slots <= slots_at_most &&
           structure.header.primitive_count <= u.primitive_count && structure.header.split_from == 0u;
}

Box empty_box() {
    return Box(uintBitsToFloat(uvec3(0x7F800000u)), uintBitsToFloat(uvec3(0xFF800000u)));
}

Box box_around(Box a, Box b) {
    return Box(min(a.lo, b.lo), max(a.hi, b.hi));
}

// ---- leaves ----

uint primitive_of(Work w, uint position) {
    if (SOURCE == SOURCE_ENTRIES) return Instances(w.records).instance[position].instance;
    if (kind_of_records() == KIND_BOXES) return BoxRecords(w.records).box[position].primitive;
    return Triangles(w.records).triangle[position].primitive;
}

// Makes a record one that no ray meets, and that no other primitive has: a triangle of negative zeros, a box inside out, an
// instance without a structure. It keeps the primitive, which a later update may bring back.
void leave_out(Work w, uint position, uint primitive) {
    if (SOURCE == SOURCE_ENTRIES) {
        const vec4 none[3] = vec4[3](vec4(0), vec4(0), vec4(0));
        Instances(w.records).instance[position] = Instance(none, none, uvec2(0), 0, 0, primitive, 0, 0, 0);
    } else if (kind_of_records() == KIND_BOXES) {
        Box b = empty_box();
        BoxRecords(w.records).box[position] = BoxRecord(b.lo, b.hi, primitive);
    } else {
        vec3 zero = uintBitsToFloat(uvec3(0x80000000u));
        Triangles(w.records).triangle[position] = Triangle(zero, zero, zero, primitive);
    }
}

// Makes a record again. Returns its box, which is empty if it is left out; `status` gets the reason.
Box refit_record(Work w, uint position, inout uint status) {
    uint primitive = primitive_of(w, position);
    uint why_not = STATUS_INDEX_OUT_OF_RANGE;
    Box b;
    Corners c;
    if (primitive < w.primitive_count) why_not = write_record(w.records, position, w.geometry, primitive, b, c);
    if (why_not == 0u) return b;
    status |= why_not;
    leave_out(w, position, primitive);
    return empty_box();
}

// A leaf with nothing left keeps its box.
void set_leaf_box(Work w, uint child, Box b) {
    if (b.lo.x <= b.hi.x) {
        w.children.child[child].lo = b.lo;
        w.children.child[child].hi = b.hi;
    }
}

uint end_of(Work w, uint first, uint count) {
    return first + min(count, w.record_count - min(first, w.record_count));
}

// The box of the records first..end, made again by all lanes of the subgroup together.
Box refit_together(Work w, uint first, uint end, inout uint status) {
    // Whatever lanes there are: the real subgroup may be smaller than the device reports.
    uvec4 lanes = subgroupBallot(true);
    uint rank = subgroupBallotExclusiveBitCount(lanes), count = subgroupBallotBitCount(lanes);
    Box b = empty_box();
    for (uint round = first; round < end; round += count) {
        if (round + rank < end) b = box_around(b, refit_record(w, round + rank, status));
    }
    return Box(subgroupMin(b.lo), subgroupMax(b.hi));
}

float cost_of(Work w, Child child) {
    if (child.count == 0u) return w.costs.value[min(child.index, w.slots - 1u)];
    return leaf_cost(c_i, scaled_half_area(Box(child.lo, child.hi), w.area_scale), child.count);
}

// The box of a slot whose children are done goes to the child that names it. Returns the way up.
uint refit_slot(Work w, uint slot) {
    Child left = w.children.child[2 * slot], right = w.children.child[2 * slot + 1];
    Box b = Box(min(left.lo, right.lo), max(left.hi, right.hi));
    float cost = inner_cost(c_t, scaled_half_area(b, w.area_scale), cost_of(w, left), cost_of(w, right));
    uint way = w.ways.word[slot];
    uint child = way & CHILD;
    if ((way & IS_ROOT) != 0u) {
        w.structure.header.root.lo = b.lo;
        w.structure.header.root.hi = b.hi;
        w.structure.header.cost = cost;
    } else if (child / 2u < w.slots) {
        w.costs.value[slot] = cost;
        w.children.child[child].lo = b.lo;
        w.children.child[child].hi = b.hi;
    }
    return way;
}

void refit_leaves(Update u, uint task) {
    Work w;
    if (!begin(u, w)) return;
    uint status = 0;
    uint run = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * RUN;
    uint root = NONE;
    if (w.structure.header.root.count == 0u) root = w.structure.header.root.index;
    uint root_count = w.structure.header.active_count == 0u ? 0u : w.structure.header.root.count;
    if (task == 0u && gl_SubgroupID == 0u && root_count != 0u) {
        uint first = w.structure.header.root.index;
        Box b = refit_together(w, first, end_of(w, first, root_count), status);
        if (subgroupElect() && b.lo.x <= b.hi.x) {
            w.structure.header.root.lo = b.lo;
            w.structure.header.root.hi = b.hi;
        }
        if (subgroupElect()) w.structure.header.cost = cost_of(w, w.structure.header.root);
    }

    // The ways up from inner children, and which children are leaves: a bit for each slot of the run.
    uint left_leaves = 0, right_leaves = 0, large_left = 0, large_right = 0, has_parent_here = 0;
    uint slots_here = min(RUN, w.slots - min(run, w.slots));
    for (uint k = 0; k < slots_here; ++k) {
        uint slot = run + k;
        uint left = w.children.child[2 * slot].index, right = w.children.child[2 * slot + 1].index;
        uint left_count = w.children.child[2 * slot].count, right_count = w.children.child[2 * slot + 1].count;
        uint bit = 1u << k;
        bool is_used = left_count != UNUSED;
        bool left_is_inner = is_used && left_count == 0u && left < w.slots;
        bool right_is_inner = is_used && right_count == 0u && right < w.slots;
        uint way = left_is_inner && right_is_inner ? 2 * slot | HAS_INNER_SIBLING : 2 * slot;
        if (left_is_inner) w.ways.word[left] = way;
        if (right_is_inner) w.ways.word[right] = way + 1u;
        if (slot == root) w.ways.word[slot] = IS_ROOT;
        has_parent_here |= left_is_inner && left - run < RUN ? 1u << (left - run) : 0u;
        has_parent_here |= right_is_inner && right - run < RUN ? 1u << (right - run) : 0u;
        left_leaves |= is_used && left_count != 0u ? bit : 0u;
        right_leaves |= is_used && right_count != 0u ? bit : 0u;
        large_left |= is_used && left_count >= LARGE ? bit : 0u;
        large_right |= is_used && right_count >= LARGE ? bit : 0u;
    }
    uint starts = left_leaves & right_leaves;
    left_leaves &= ~large_left;
    right_leaves &= ~large_right;

    while (true) {
        uint mine = NONE;
        if (large_left != 0u) mine = 2u * (run + findLSB(large_left));
        else if (large_right != 0u) mine = 2u * (run + findLSB(large_right)) + 1u;
        uint child = subgroupMin(mine);
        if (child == NONE) break;
        uint first = w.children.child[child].index;
        Box b = refit_together(w, first, end_of(w, first, w.children.child[child].count), status);
        if (mine == child) {
            set_leaf_box(w, child, b);
            if (large_left != 0u) large_left &= large_left - 1u;
            else large_right &= large_right - 1u;
        }
    }

    // A record a round, however many the leaves have: lanes with short leaves need not wait for long ones.
    uint child = NONE, position = 0, end = 0;
    Box b;
    for (uint round = 0; round < 2u * RUN * LARGE; ++round) {
        if (position == end) {
            if (child != NONE) set_leaf_box(w, child, b);
            bool is_left = left_leaves != 0u;
            uint leaves = is_left ? left_leaves : right_leaves;
            if (leaves == 0u) break;
            child = 2u * (run + findLSB(leaves)) + (is_left ? 0u : 1u);
            leaves &= leaves - 1u;
            left_leaves = is_left ? leaves : 0u;
            right_leaves = is_left ? right_leaves : leaves;
            position = w.children.child[child].index;
            end = end_of(w, position, w.children.child[child].count);
            b = empty_box();
            if (position == end) continue;
        }
        b = box_around(b, refit_record(w, position, status));
        position++;
    }
    status = subgroupOr(status & ~INACTIVE);
    if (status != 0u && subgroupElect()) atomicOr(w.structure.header.status, status);

    // What can be done without leaving the run.
    uint done = starts & ~has_parent_here, waiting = 0, slot = NONE;
    starts &= has_parent_here;
    for (uint round = 0; round < RUN; ++round) {
        if (slot == NONE) {
            if (starts == 0u) break;
            slot = run + findLSB(starts);
            starts &= starts - 1u;
        }
        uint way = refit_slot(w, slot);
        uint parent = (way & CHILD) / 2u;
        uint bit = 1u << (parent - run);
        bool has_to_wait = (way & HAS_INNER_SIBLING) != 0u && (waiting & bit) == 0u;
        if ((way & HAS_INNER_SIBLING) != 0u) waiting ^= bit;
        if (!has_to_wait && (has_parent_here & bit) == 0u) done |= bit;
        slot = has_to_wait || (has_parent_here & bit) == 0u ? NONE : parent;
    }
    if (run < w.slots) {
        w.starts.word[run / RUN] = done;
        w.waiting.word[run / RUN] = waiting;
    }
}

// ---- climb ----

// Of two inner children the second that is done goes on with their parent. An invocation that has the parent in its own run
// waits for itself before it asks the others.
void refit_climb(Update u, uint task) {
    Work w;
    if (!begin(u, w)) return;
    uint run = (task * gl_WorkGroupSize.x + gl_LocalInvocationIndex) * RUN;
    if (run >= w.slots) return;
    uint starts = w.starts.word[run / RUN];
    uint waiting = w.waiting.word[run / RUN];
    uint slot = NONE, arrives_at = NONE;
    // Bounds: a run has this many starts, each waits there at most once for either side, and this is the longest way up.
    for (uint round = 0; round < 3u * RUN * (MAX_DEPTH + 2u); ++round) {
        if (slot == NONE && arrives_at == NONE) {
            if (starts != 0u) {
                slot = run + findLSB(starts);
                starts &= starts - 1u;
            } else if (waiting != 0u) {
                arrives_at = run + findLSB(waiting);
                waiting &= waiting - 1u;
            } else {
                break;
            }
        }
        if (arrives_at != NONE) {
            release_to_device();
            if ((atomicOr(w.ways.word[arrives_at], ARRIVED) & ARRIVED) != 0u) {
                acquire_from_device();
                slot = arrives_at;
            }
            arrives_at = NONE;
        }
        if (slot != NONE) {
            uint way = refit_slot(w, slot);
            uint parent = (way & CHILD) / 2u;
            bool ends = (way & IS_ROOT) != 0u || parent >= w.slots;
            bool has_to_meet = !ends && (way & HAS_INNER_SIBLING) != 0u;
            slot = ends || has_to_meet ? NONE : parent;
            if (has_to_meet && parent - run < RUN) {
                uint bit = 1u << (parent - run);
                if ((waiting & bit) != 0u) slot = parent;
                waiting ^= bit;
            } else if (has_to_meet) {
                arrives_at = parent;
            }
        }
    }
}
#endif
