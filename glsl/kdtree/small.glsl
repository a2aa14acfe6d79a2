// Subtrees of no more than EXACT references, each by one workgroup to its leaves: src/kdtree/host/small.rs is the twin. Every face of
// every box is a plane that is looked at, and all boxes are looked at for each.
//
// The left child is done first, what is on the right waits on a stack in memory. Nodes and references are written to the workgroup's
// own memory, and when all are there to a place that an atomic gives: placing them in order is kdtree/place.glsl's.
//
// Loops test at their ends: lavapipe goes through one that tests at its beginning once more, with no lane active.
#ifndef HEDGEROW_KDTREE_SMALL
#define HEDGEROW_KDTREE_SMALL
#include "kdtree/heuristic.glsl"
#include "kdtree/clip.glsl"
#extension GL_KHR_shader_subgroup_shuffle : require

// As src/kdtree/host/small.rs has it.
const uint MOST_NODES = 254;
const uint MOST_LEAF_REFERENCES = (MOST_NODES / 2 + 2) * EXACT;

// The cell's references: faces along x, y and z, first all least ones; and the records. Two sets, as a set is made of the other.
shared float small_lo[2 * 3 * EXACT];
shared float small_hi[2 * 3 * EXACT];
shared uint small_record[2 * EXACT];
// Of each reference its sides; of those that straddle the plane which, and the boxes of their parts.
shared uint small_side[EXACT];
shared uint small_straddling[EXACT];
shared float part_lo[3 * 2 * EXACT];
shared float part_hi[3 * 2 * EXACT];
shared uint small_part_is_there[2 * EXACT];

// A right child that waits.
struct KdWaiting {
    vec3 lo;
    uint count;
    vec3 hi;
    uint slot;
    uint depth;
};

BUFFER KdWaitings { KdWaiting waiting[]; };

// The memory of a workgroup: what waits, its references, nodes, references of leaves.
struct KdStack {
    KdWaitings waiting;
    KdReferences references;
    KdNodes nodes;
    Words leaves;
};

const uint WAITING_BYTES = 36 * KD_MAX_DEPTH;
const uint WAITING_REFERENCE_BYTES = 28 * EXACT * KD_MAX_DEPTH;
const uint STACK_BYTES = WAITING_BYTES + WAITING_REFERENCE_BYTES + 8 * (MOST_NODES + 2) + 4 * MOST_LEAF_REFERENCES;

KdStack stack_of(uint worker) {
    uvec2 at = address_of(build_state().stacks, worker, STACK_BYTES);
    uvec2 references = address_of(at, 1u, WAITING_BYTES);
    uvec2 nodes = address_of(references, 1u, WAITING_REFERENCE_BYTES);
    return KdStack(KdWaitings(at), KdReferences(references), KdNodes(nodes), Words(address_of(nodes, MOST_NODES + 2u, 8u)));
}

void set_reference(uint set, uint i, Box b, uint record) {
    for (uint axis = 0; axis < 3; ++axis) {
        small_lo[(3 * set + axis) * EXACT + i] = b.lo[axis];
        small_hi[(3 * set + axis) * EXACT + i] = b.hi[axis];
    }
    small_record[set * EXACT + i] = record;
}

Box box_of(uint set, uint i) {
    Box b;
    for (uint axis = 0; axis < 3; ++axis) {
        b.lo[axis] = small_lo[(3 * set + axis) * EXACT + i];
        b.hi[axis] = small_hi[(3 * set + axis) * EXACT + i];
    }
    return b;
}

// How many boxes are on the left of a plane, in it, and on its right.
struct Counts {
    uint left;
    uint planar;
    uint right;
};

void count_box(inout Counts counts, float lo, float hi, float at) {
    counts.left += lo < at ? 1u : 0u;
    counts.planar += lo == at && hi == at ? 1u : 0u;
    counts.right += hi > at ? 1u : 0u;
}

void consider(inout KdPlane best, Box cell, float area_scale, uint axis, float at, Counts counts) {
    bool planar_left;
    uint cost = plane_cost(cell, area_scale, axis, at, uvec3(counts.left, counts.planar, counts.right), false, planar_left);
    KdPlane plane = KdPlane(cost, axis, ordered_float(positive_zero(at)), planar_left);
    if (cost != INFINITE && is_better(plane, best)) best = plane;
}

// The planes at the two faces of each lane's own box across an axis. The lanes of a subgroup load as many boxes as they are, and look
// at all of them.
void consider_faces(inout KdPlane best, uint lanes, uint set, uint count, uint axis, float lo, float hi, Box cell, float area_scale) {
    Counts at_lo = Counts(0u, 0u, 0u), at_hi = Counts(0u, 0u, 0u);
    uint tile = 0;
    do {
        float others_lo = lo, others_hi = hi;
        if (count > lanes || gl_NumSubgroups > 1u) {
            uint i = (3u * set + axis) * EXACT + min(tile + gl_SubgroupInvocationID, count - 1u);
            others_lo = small_lo[i];
            others_hi = small_hi[i];
        }
        uint turns = min(lanes, count - tile), turn = 0;
        do {
            float l = subgroupShuffle(others_lo, turn), h = subgroupShuffle(others_hi, turn);
            count_box(at_lo, l, h, lo);
            count_box(at_hi, l, h, hi);
        } while (++turn < turns);
        tile += lanes;
    } while (tile < count);
    consider(best, cell, area_scale, axis, lo, at_lo);
    consider(best, cell, area_scale, axis, hi, at_hi);
}

// The best of the planes at the faces of the boxes. Each lane has a box, and looks at those of the other lanes in turn: they come out of
// registers, which is cheaper than shared memory, much so on lavapipe.
KdPlane best_of_faces(uint set, uint count, Box cell, float area_scale) {
    KdPlane best = no_plane();
    // However many the subgroup really has: all are active here.
    uint lanes = subgroupBallotBitCount(subgroupBallot(true)), base = 0;
    do {
        // A lane without one looks at the last one again.
        Box own = box_of(set, min(base + gl_LocalInvocationIndex, count - 1u));
        consider_faces(best, lanes, set, count, 0u, own.lo.x, own.hi.x, cell, area_scale);
        consider_faces(best, lanes, set, count, 1u, own.lo.y, own.hi.y, cell, area_scale);
        consider_faces(best, lanes, set, count, 2u, own.lo.z, own.hi.z, cell, area_scale);
        base += gl_WorkGroupSize.x;
    } while (base < count);
    return best_of_all(best);
}

// Tells the sides of all references, and the boxes of the parts of those on both: item 2k is the part on the left of the k-th.
void divide(uint set, uint count, Box cell, uint axis, float plane, bool planar_left) {
    uint straddlers = 0, base = 0;
    do {
        uint i = base + gl_LocalInvocationIndex;
        bvec2 is_there = bvec2(false);
        if (i < count) is_there = sides_of(box_of(set, i), axis, plane, planar_left);
        uint total;
        uint at = straddlers + sum_before(all(is_there) ? 1u : 0u, total);
        if (all(is_there)) small_straddling[at] = i;
        if (i < count) small_side[i] = (is_there.x ? 1u : 0u) | (is_there.y ? 2u : 0u) | (all(is_there) ? at + 1u << 2 : 0u);
        straddlers += total;
        base += gl_WorkGroupSize.x;
    } while (base < count);
    barrier();
    if (straddlers == 0u) return;
    float reach = build_state().reach;
    Box halves[2];
    half_cells(cell, axis, plane, halves[0], halves[1]);
    uint item = gl_LocalInvocationIndex;
    if (item < 2u * straddlers) do {
        uint i = small_straddling[item >> 1];
        Box half_cell = halves[0], part;
        if ((item & 1u) == 1u) half_cell = halves[1];
        bool is_there = clip_triangle(corners_of_record(small_record[set * EXACT + i]), reach, half_cell, part);
        // Kept where rounding has it that the triangle is in neither half.
        if (!is_there) part = common_part(box_of(set, i), half_cell);
        small_part_is_there[item] = is_there ? 1u : 0u;
        for (uint k = 0; k < 3; ++k) {
            part_lo[k * 2u * EXACT + item] = part.lo[k];
            part_hi[k * 2u * EXACT + item] = part.hi[k];
        }
        item += gl_WorkGroupSize.x;
    } while (item < 2u * straddlers);
    barrier();
    uint k = gl_LocalInvocationIndex;
    if (k < straddlers) do {
        uint left = small_part_is_there[2u * k], right = small_part_is_there[2u * k + 1u];
        if (left + right == 1u) small_side[small_straddling[k]] = (left == 1u ? 1u : 2u) | k + 1u << 2;
        k += gl_WorkGroupSize.x;
    } while (k < straddlers);
    barrier();
}

Box part_of(uint item) {
    Box b;
    for (uint k = 0; k < 3; ++k) {
        b.lo[k] = part_lo[k * 2u * EXACT + item];
        b.hi[k] = part_hi[k * 2u * EXACT + item];
    }
    return b;
}

// What is on the left goes to the other set, what is on the right to where it waits; returns how many.
uvec2 part(uint set, uint count, KdReferences right, uint right_at) {
    uvec2 counts = uvec2(0);
    uint base = 0;
    do {
        uint i = base + gl_LocalInvocationIndex;
        uint side = i < count ? small_side[i] : 0u;
        uvec2 total;
        uvec2 at = counts + sum_before(uvec2(side & 1u, side >> 1 & 1u), total);
        if (side != 0u) {
            uint record = small_record[set * EXACT + i], k = side >> 2;
            Box own = box_of(set, i), own_left = own, own_right = own;
            if (k != 0u) {
                own_left = part_of(2u * k - 2u);
                own_right = part_of(2u * k - 1u);
            }
            if ((side & 1u) != 0u) set_reference(1u - set, at.x, own_left, record);
            if ((side & 2u) != 0u) right.reference[right_at + at.y] = KdReference(own_right.lo, record, own_right.hi);
        }
        counts += total;
        base += gl_WorkGroupSize.x;
    } while (base < count);
    next_phase();
    return counts;
}

void load_references(uint set, KdReferences from, uint begin, uint count) {
    uint i = gl_LocalInvocationIndex;
    if (i < count) do {
        KdReference r = from.reference[begin + i];
        set_reference(set, i, Box(r.lo, r.hi), r.record);
        i += gl_WorkGroupSize.x;
    } while (i < count);
    barrier();
}

// A subtree in the memory of the workgroup that has built it.
struct KdBuilt {
    uint nodes;         // below its root
    uint references;    // of its leaves
    uvec3 tallies;      // inner nodes, leaves, empty leaves
    uint deepest;
};

// Builds the subtree of a cell of `count` references, from `begin` on, into `stack`.
KdBuilt build_small(KdReferences from, uint begin, uint count, Box cell, uint depth, KdStack stack) {
    float area_scale = build_state().area_scale;
    uint set = 0, slot = 0, waiting = 0, nodes = 0, references = 0, deepest = depth;
    uvec3 tallies = uvec3(0);
    load_references(set, from, begin, count);
    // Each turn makes a node.
    for (uint turn = 0; turn <= MOST_NODES; ++turn) {
        deepest = max(deepest, depth);
        KdPlane best = no_plane();
        if (!ends_by_rule(count, depth) && nodes + 2u <= MOST_NODES) best = best_of_faces(set, count, cell, area_scale);
        if (best.cost != INFINITE && pays(best.cost, cell, area_scale, count)) {
            float at = float_of_ordered(best.place);
            divide(set, count, cell, best.axis, at, best.planar_left);
            uvec2 counts = part(set, count, stack.references, waiting * EXACT);
            Box left, right;
            half_cells(cell, best.axis, at, left, right);
            uint first_child = 1u + nodes;
            uint is_left = counts.x > 0u ? 1u : 0u, is_right = counts.y > 0u ? 1u : 0u;
            uint right_slot = first_child + is_left;
            if (gl_LocalInvocationIndex == 0u) {
                stack.nodes.node[slot] = kd_inner(best.axis, at, first_child, is_left == 0u, is_right == 0u);
                stack.waiting.waiting[waiting] = KdWaiting(right.lo, counts.y, right.hi, right_slot, depth + 1u);
            }
            nodes += is_left + is_right;
            tallies += uvec3(1u, 0u, 2u - is_left - is_right);
            depth += 1u;
            if (is_left == 1u) {
                waiting += is_right;
                set = 1u - set;
                count = counts.x;
                cell = left;
                slot = first_child;
            } else {
                load_references(set, stack.references, waiting * EXACT, counts.y);
                count = counts.y;
                cell = right;
                slot = right_slot;
            }
        } else {
            if (gl_LocalInvocationIndex == 0u) stack.nodes.node[slot] = kd_leaf(references, count);
            uint i = gl_LocalInvocationIndex;
            if (i < count) do {
                stack.leaves.word[references + i] = small_record[set * EXACT + i];
                i += gl_WorkGroupSize.x;
            } while (i < count);
            references += count;
            tallies.y += 1u;
            if (waiting == 0u) break;
            waiting--;
            next_phase();
            KdWaiting next = stack.waiting.waiting[waiting];
            load_references(set, stack.references, waiting * EXACT, next.count);
            count = next.count;
            depth = next.depth;
            cell = Box(next.lo, next.hi);
            slot = next.slot;
        }
    }
    next_phase();
    return KdBuilt(nodes, references, tallies, deepest);
}

// Writes the subtree beside others that wait. Without room, its root becomes a leaf.
void write_subtree(uint s, KdTask t, KdReferences level_references, KdStack stack, KdBuilt built) {
    KdState state = build_state();
    uint nodes = built.nodes, references = built.references, depth = built.deepest;
    uvec3 tallies = built.tallies;
    KdSubtrees subtrees = all_subtrees();
    if (gl_LocalInvocationIndex == 0u) {
        uint nodes_at = atomicAdd(state.subtree_nodes, nodes);
        uint references_at = atomicAdd(state.subtree_references, references);
        bool fits = nodes_at + nodes <= subtree_node_room() && references_at + references <= subtree_room();
        KdNode root = stack.nodes.node[0];
        if (!fits) {
            nodes_at = NONE;
            nodes = 0u;
            references = t.count;
            references_at = subtree_room() + atomicAdd(state.root_leaf_references, t.count);
            root = kd_leaf(0u, t.count);
            tallies = uvec3(0u, 1u, 0u);
            depth = t.depth;
            atomicOr(state.status, STATUS_OUT_OF_ROOM);
        }
        subtrees.subtree[s].root = root;
        subtrees.subtree[s].nodes_at = nodes_at;
        subtrees.subtree[s].nodes = nodes;
        subtrees.subtree[s].references_at = references_at;
        subtrees.subtree[s].references = references;
        atomicAdd(state.subtree_inner, tallies.x);
        atomicAdd(state.subtree_leaves, tallies.y);
        atomicAdd(state.subtree_empty, tallies.z);
        atomicMax(state.depth, depth);
    }
    next_phase();
    uint nodes_at = subtrees.subtree[s].nodes_at, references_at = subtrees.subtree[s].references_at;
    Words to_references = Words(state.leaf_references);
    if (nodes_at == NONE) {
        for (uint i = gl_LocalInvocationIndex; i < t.count; i += gl_WorkGroupSize.x) {
            to_references.word[references_at + i] = level_references.reference[t.begin + i].record;
        }
        return;
    }
    KdNodes to_nodes = KdNodes(state.nodes);
    for (uint i = gl_LocalInvocationIndex; i < nodes; i += gl_WorkGroupSize.x) {
        to_nodes.node[nodes_at + i] = stack.nodes.node[1u + i];
    }
    for (uint i = gl_LocalInvocationIndex; i < references; i += gl_WorkGroupSize.x) {
        to_references.word[references_at + i] = stack.leaves.word[i];
    }
    barrier();
}

void kd_small(uint s, uint of_level) {
    // Behind the last one of a loop, no lane active, lavapipe of Mesa 26 still loads what is the same for all lanes.
    KdTask t = tasks_of(of_level).task[min(all_subtrees().subtree[s].task, task_capacity - 1u)];
    KdStack stack = stack_of(group_number());
    KdReferences from = references_of(of_level);
    KdBuilt built = build_small(from, t.begin, t.count, Box(t.lo, t.hi), t.depth, stack);
    write_subtree(s, t, from, stack, built);
}
#endif
