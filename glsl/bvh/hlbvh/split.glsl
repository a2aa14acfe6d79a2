// The top of an HLBVH, from the root down: see bvh/hlbvh.glsl for the contract.
//
// A task is a range of the order that a workgroup splits in two by the cheapest plane, of equal ones the first. Each side keeps its
// order. Where no plane has clusters on both sides, or levels were many, the range is split in the middle.
//
// The node has the slot before the first position of the first treelet right of the split, in the order that the codes gave: as the
// splits of all tasks lie at different places, slots differ, and none is inside of a treelet.
#ifndef HEDGEROW_BVH_HLBVH_SPLIT
#define HEDGEROW_BVH_HLBVH_SPLIT
#include "bvh/hlbvh/planes.glsl"

const uint SAH_LEVELS = 40;   // as src/bvh/twin/hlbvh.rs has it
// Tasks that one has put off: it goes on with the smaller half.
const uint STACK = 32;

// The best plane of all lanes.
shared uint best_cost;
shared uint best_number;
shared uint chosen_axis;
shared float chosen_at;
shared uint chosen_bin;
shared uint chosen_middle;
shared vec3 chosen_lo[2];
shared vec3 chosen_hi[2];
// Of a task and all below it.
shared uint stack_begins[STACK];
shared uint stack_ends[STACK];
shared uint stack_links[STACK];
shared uint stack_levels[STACK];

// Of the best planes of all lanes the best: whether there is one. It is in `chosen_…` then.
bool choose(Plane own, Task t) {
    if (gl_LocalInvocationIndex == 0u) {
        best_cost = INFINITE;
        best_number = NO_PLANE;
    }
    barrier();
    uint cost = subgroupMin(own.cost);
    if (subgroupElect()) atomicMin(best_cost, cost);
    barrier();
    uint number = subgroupMin(own.cost == best_cost && own.cost != INFINITE ? own.number : NO_PLANE);
    if (subgroupElect()) atomicMin(best_number, number);
    barrier();
    if (own.number == best_number && own.cost == best_cost && own.cost != INFINITE) {
        chosen_axis = own.axis;
        chosen_at = own.at;
        chosen_bin = own.bin;
        chosen_middle = t.begin + own.left.clusters;
        chosen_lo[0] = own.left.lo;
        chosen_hi[0] = own.left.hi;
        chosen_lo[1] = own.right.lo;
        chosen_hi[1] = own.right.hi;
    }
    barrier();
    return best_number != NO_PLANE;
}

// Half of the clusters on either side, as they lie.
void choose_middle(Words order, Clusters clusters, Task t) {
    uint middle = t.begin + (t.end - t.begin) / 2u;
    Side left = empty_side(), right = empty_side();
    for (uint i = t.begin + gl_LocalInvocationIndex; i < t.end; i += gl_WorkGroupSize.x) {
        uint c = order.word[i];
        vec3 lo = clusters.cluster[c].lo, hi = clusters.cluster[c].hi;
        if (i < middle) left = with_box(left, lo, hi, 0u, 1u);
        else right = with_box(right, lo, hi, 0u, 1u);
    }
    for (uint axis = gl_LocalInvocationIndex; axis < 6u; axis += gl_WorkGroupSize.x) {
        bin_lo[axis] = NONE;
        bin_hi[axis] = 0u;
    }
    barrier();
    uvec3 lo[2], hi[2];
    lo[0] = subgroupMin(ordered(left.lo));
    hi[0] = subgroupMax(ordered(left.hi));
    lo[1] = subgroupMin(ordered(right.lo));
    hi[1] = subgroupMax(ordered(right.hi));
    if (subgroupElect()) {
        for (uint i = 0; i < 6u; ++i) {
            atomicMin(bin_lo[i], lo[i / 3u][i % 3u]);
            atomicMax(bin_hi[i], hi[i / 3u][i % 3u]);
        }
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        chosen_middle = middle;
        for (uint side = 0; side < 2u; ++side) {
            chosen_lo[side] = from_ordered(uvec3(bin_lo[3u * side], bin_lo[3u * side + 1u], bin_lo[3u * side + 2u]));
            chosen_hi[side] = from_ordered(uvec3(bin_hi[3u * side], bin_hi[3u * side + 1u], bin_hi[3u * side + 2u]));
        }
    }
    barrier();
}

// Moves what is left of the plane before what is right of it.
void move_to_sides(Words from, Words to, Clusters clusters, Task t, bool is_swept, Slabs slabs, float area_scale) {
    uint axis = chosen_axis, bin = chosen_bin, middle = chosen_middle;
    float at = chosen_at;
    uint left = 0;
    for (uint base = t.begin; base < t.end; base += gl_WorkGroupSize.x) {
        uint i = base + gl_LocalInvocationIndex;
        uint c = from.word[min(i, t.end - 1u)];
        vec3 point = centroid_of(Box(clusters.cluster[c].lo, clusters.cluster[c].hi));
        bool goes_left = is_swept ? point[axis] <= at : bins_of(slabs, point, area_scale)[axis] <= bin;
        uint total;
        uint before = left + sum_before(goes_left && i < t.end ? 1u : 0u, total);
        if (i < t.end) to.word[goes_left ? t.begin + before : middle + (i - t.begin - before)] = c;
        left += total;
    }
}

// What a link names is the node in a slot.
void name_node(uint link, uint slot) {
    child_words(link).word[INDEX_WORD] = slot;
}

// Splits a task of a level by the whole workgroup. Outputs the node's slot, and where the right side begins.
uint split(Task t, uint level, out uint middle) {
    Structure structure = Structure(structure_address);
    Weights w = weights();
    Clusters clusters = all_clusters();
    Words from = order_of(level), to = order_of(level + 1u);
    float area_scale = build_state().plan.area_scale;
    uint count = t.end - t.begin;
    bool is_swept = count <= SWEPT, is_found = false;
    Slabs slabs = Slabs(vec3(0.0), vec3(0.0));
    if (count > 2u && level < SAH_LEVELS) {
        Plane own;
        if (is_swept) {
            own = sweep(from, clusters, t, area_scale);
        } else {
            find_centroids(from, clusters, t);
            slabs = slabs_of(area_scale);
            if (PRIVATE_COUNTERS) fill_own_bins(from, clusters, t, slabs, area_scale);
            else fill_bins(from, clusters, t, slabs, area_scale);
            own = best_of_bins(area_scale);
        }
        is_found = choose(own, t);
    }
    if (is_found) {
        move_to_sides(from, to, clusters, t, is_swept, slabs, area_scale);
    } else {
        choose_middle(from, clusters, t);
        for (uint i = t.begin + gl_LocalInvocationIndex; i < t.end; i += gl_WorkGroupSize.x) to.word[i] = from.word[i];
    }
    next_phase();
    middle = chosen_middle;
    uint slot = clusters.cluster[safe_place(middle)].first - 1u;
    if (gl_LocalInvocationIndex == 0u) {
        w.counts.node[slot].all = 0u;
        w.parents.word[slot] = t.link;
        Child children[2];
        for (uint side = 0; side < 2u; ++side) {
            uint begin = side == 0u ? t.begin : middle, end = side == 0u ? middle : t.end;
            children[side] = Child(chosen_lo[side], 0u, chosen_hi[side], 0u);
            if (end - begin == 1u) {
                Cluster c = clusters.cluster[listed(to, begin)];
                children[side] = child_of(c);
                w.parents.word[parent_at(c.reference)] = 2u * slot + side;
            }
        }
        structure.nodes[slot] = Node(children[0], children[1]);
        name_node(t.link, slot);
        if (t.link == NO_PARENT) {
            structure.header.root.lo = min(chosen_lo[0], chosen_lo[1]);
            structure.header.root.hi = max(chosen_hi[0], chosen_hi[1]);
            structure.header.root.count = 0u;
        }
    }
    // Shared memory is free for the next.
    barrier();
    return slot;
}

Task task_at(uint level, uint i) {
    if (level == 0u) return Task(0u, treelet_count(), NO_PARENT);
    return all_tasks().task[safe_place(first_task(level) + i)];
}

void push(inout uint level, Task t, uint of_level) {
    if (gl_LocalInvocationIndex == 0u) {
        stack_begins[level] = t.begin;
        stack_ends[level] = t.end;
        stack_links[level] = t.link;
        stack_levels[level] = of_level;
    }
    level++;
}

// Sides of two clusters or more are tasks of a level, in any order, on which nothing depends.
void hand_on(Task left, Task right, uint level) {
    if (gl_LocalInvocationIndex != 0u) return;
    Tasks tasks = all_tasks();
    uint lefts = left.end - left.begin > 1u ? 1u : 0u, rights = right.end - right.begin > 1u ? 1u : 0u;
    if (lefts + rights == 0u) return;
    PoolState pool = PoolState(scratch_address);
    uint at = first_task(level) + atomicAdd(pool.tasks[pool_phase(PHASE_SPLIT + level)], lefts + rights);
    if (lefts == 1u) tasks.task[at] = left;
    if (rights == 1u) tasks.task[at + lefts] = right;
}

// A task of a level, or with all below it where no further level is recorded.
//
// One loop for both: a kernel that does both would have all of `split` twice.
void hlbvh_split(uint i, uint level, bool all_below) {
    Task t = task_at(level, i);
    uint nodes = all_below ? t.end - t.begin - 1u : 1u;
    uint waiting = 0;
    for (uint node = 0; node < nodes; ++node) {
        uint middle;
        uint slot = split(t, level, middle);
        Task left = Task(t.begin, middle, 2u * slot), right = Task(middle, t.end, 2u * slot + 1u);
        level++;
        if (!all_below) {
            hand_on(left, right, level);
            break;
        }
        bool left_is_small = middle - t.begin <= t.end - middle;
        Task small = left_is_small ? left : right, large = left_is_small ? right : left;
        if (small.end - small.begin > 1u) push(waiting, large, level);
        t = small.end - small.begin > 1u ? small : large;
        if (t.end - t.begin == 1u && waiting > 0u) {
            waiting--;
            barrier();
            t = Task(stack_begins[waiting], stack_ends[waiting], stack_links[waiting]);
            level = stack_levels[waiting];
        }
        next_phase();
    }
}
#endif
