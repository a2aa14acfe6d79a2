// The steps `reset`, `open` and `open_few` of bvh/wide/collapse.glsl: find the children of a wide node, and list those that are nodes.
#ifndef HEDGEROW_BVH_WIDE_OPEN
#define HEDGEROW_BVH_WIDE_OPEN
#include "bvh/wide/choice.glsl"
#include "bvh/wide/octants.glsl"

// What is known of the children so far, beside open_middle.
uint open_name[8];
uint open_index[8];
uint open_count[8];
// How many places it takes. Children of several are opened; 0: of one that must not be.
uint open_places[8];
// Which child comes first, second and so on where the source's left-first walk meets them: four bits each.
uint open_order;

// Edges of a child's box, of an area that counts.
vec3 edges_of(Child child) {
    return scaled_edges(Box(child.lo, child.hi), source.header.area_scale);
}

// Half of the area of a box in a quantised root: it may be a cell longer.
float area_in_root(Child child) {
    precise vec3 edges = edges_of(child) + edges_of(source.header.root) * (1.0 / 128.0);
    return half_area_of_edges(edges);
}

// Whether a visit of an inner child of a quantised root costs less than to have its children in the root, whose cells may be much larger
// than they are.
bool is_closed(Child child) {
    if (!QUANTISED) return false;
    Child left = child_named(2 * child.index), right = child_named(2 * child.index + 1);
    precise float opened = area_in_root(left) + area_in_root(right);
    precise float closed = area_in_root(child) + (half_area_of_edges(edges_of(left)) + half_area_of_edges(edges_of(right)));
    return opened > closed;
}

// A child that is given so many places, of which it takes what makes it cheaper.
void put_child(uint at, uint name, uint places, uint level) {
    Child child = child_named(name);
    if (!is_inner(child)) places = 1;
    else if (level == 0 && is_closed(child)) places = 0;
    else if (level < LEVELS_BY_COST && places > 1) places = places_by(choices.word[child.index], places);
    vec3 middle = QUANTISED ? quarter_middle(child.lo, child.hi) : vec3(0);
    if (IN_REGISTERS) {
        for (uint i = 0; i < 8; ++i) {
            bool is_here = i == at;
            open_name[i] = is_here ? name : open_name[i];
            open_index[i] = is_here ? child.index : open_index[i];
            open_count[i] = is_here ? child.count : open_count[i];
            open_places[i] = is_here ? places : open_places[i];
            if (QUANTISED) open_middle[i] = is_here ? middle : open_middle[i];
        }
    } else {
        open_name[at] = name;
        open_index[at] = child.index;
        open_count[at] = child.count;
        open_places[at] = places;
        if (QUANTISED) open_middle[at] = middle;
    }
}

// The children of binary node `slot` share so many places: the left one goes to `left`, the right one to `right`.
void put_children(uint left, uint right, uint slot, uint places, uint level) {
    uint of_left = level < LEVELS_BY_COST ? places_of_left_by(choices.word[slot], places) : places / 2;
    put_child(left, 2 * slot, of_left, level);
    put_child(right, 2 * slot + 1, places - of_left, level);
}

// Where child `opened` was, its two children come: itself, which is the left one now, and `right` right behind it.
void put_right_behind(uint opened_child, uint right) {
    uint place = 0;
    while (place < 7 && (open_order >> 4 * place & 15u) != opened_child) ++place;
    uint bits = 4 * (place + 1);
    uint behind = place < 6 ? open_order >> bits << bits + 4 : 0;
    open_order = open_order & (1u << bits) - 1u | right << bits | behind;
}

// Whether the rays that went into the first of two children ended there for less work than those in the second. A few rays that take a
// step and end nowhere stand beside those of each.
bool ends_more_rays(uint first_name, uint second_name) {
    LinkCount first = hits.count[first_name], second = hits.count[second_name];
    precise float of_first = float(first.hits) * (float(second.work) + PRIOR_WORK);
    precise float of_second = float(second.hits) * (float(first.work) + PRIOR_WORK);
    return of_first > of_second;
}

// What names a child, its index and its count; NO_CHILD for the eighth and others behind.
uvec3 child_at(uint i) {
    uvec3 child = uvec3(NO_CHILD, 0, 0);
    if (IN_REGISTERS) {
        for (uint k = 0; k < 8; ++k) child = k == i ? uvec3(open_name[k], open_index[k], open_count[k]) : child;
    } else if (i < 8) {
        child = uvec3(open_name[i], open_index[i], open_count[i]);
    }
    return child;
}

// The first of the children that is opened, and how many places its own two share. What fits as a whole is taken in, even where sums of
// costs were too large to tell. 8: there is none.
uvec2 next_to_open(uint count, uint level) {
    uvec2 next = uvec2(8, 0);
    for (uint i = 0; i < (IN_REGISTERS ? 8 : count); ++i) {
        if (next.x == 8 && i < count && open_places[i] > 1) next = uvec2(i, open_places[i]);
    }
    if (next.x == 8 && level < LEVELS_BY_COST) {
        for (uint i = 0; i < (IN_REGISTERS ? 8 : count); ++i) {
            bool may_fit = next.x == 8 && i < count && open_count[i] == 0 && open_places[i] != 0;
            if (may_fit && children_by(choices.word[open_index[i]]) <= WIDTH - count + 1) next = uvec2(i, WIDTH);
        }
    }
    return next;
}

// The children of the wide node that begins with the binary node `slot`: how many.
uint open_children(uint slot, uint level, Child root) {
    open_order = 0x10u;
    if (!is_inner(root)) {
        put_child(0, WHOLE_TREE, 1, level);
        return 1;
    }
    put_children(0, 1, slot, WIDTH, level);
    uint count = 2;
    while (count < WIDTH) {
        uvec2 next = next_to_open(count, level);
        if (next.x == 8) break;
        put_children(next.x, count, child_at(next.x).y, next.y, level);
        put_right_behind(next.x, count);
        count++;
    }
    return count;
}

// Of the binary node that a wide one begins with, whose box is that of the wide one.
vec3 middle_of_node(uint slot) {
    Child root = source.header.root;
    if (!is_inner(root)) return quarter_middle(root.lo, root.hi);
    Child left = child_named(2 * slot), right = child_named(2 * slot + 1);
    return quarter_middle(min(left.lo, right.lo), max(left.hi, right.hi));
}

// Children that end more rays for their work first; equal ones stay as they are.
void order_by_hits(uint count) {
    for (uint place = 1; place < count; ++place) {
        for (uint at = place; at > 0; --at) {
            uint here = open_order >> 4 * at & 15u, before = open_order >> 4 * (at - 1) & 15u;
            if (!ends_more_rays(child_at(here).x, child_at(before).x)) break;
            uint swap = here ^ before;
            open_order ^= swap << 4 * at | swap << 4 * (at - 1);
        }
    }
}

// Lists the nodes of the lanes of a subgroup in one piece. All of them come here together, those that have none, too.
uint place_in_next_level(uint level, uint nodes) {
    uint before = subgroupExclusiveAdd(nodes);
    uint all = subgroupAdd(nodes);
    uint first = 0;
    if (subgroupElect()) first = atomicAdd(levels.count[level + 1], all);
    return subgroupBroadcastFirst(first) + before;
}

// Opens the node `i` of a level (the first of opened, and how many), if there is one. All invocations of a workgroup come here
// together.
void open(uint i, uvec2 of, uint level) {
    bool is_there = i < of.y;
    uint at = of.x + i, slot = 0, inner = 0;
    uint in_slot[8];
    for (uint s = 0; s < 8; ++s) in_slot[s] = 8;
    if (is_there) {
        slot = opened.node[at].slot;
        uint count = open_children(slot, level, source.header.root);
        bool has_order = source.header.child_order != 0;
        if (BY_HITS && has_order) order_by_hits(count);
        for (uint s = 0; s < 8; ++s) in_slot[s] = s < count ? has_order ? open_order >> 4 * s & 15u : s : 8;
        if (QUANTISED && !has_order) octant_slots(count, middle_of_node(slot), in_slot);

        uint nodes = 0, records = 0;
        for (uint s = 0; s < WIDTH; ++s) {
            uvec3 child = child_at(in_slot[s]);
            slots.word[at * WIDTH + s] = child.x;
            if (child.x == NO_CHILD) continue;
            bool is_leaf = child.z != 0;
            if (is_leaf) records += child.z;
            if (!is_leaf) inner++;
            if (!is_leaf || is_long(child.z)) nodes++;
        }
        first_children.word[slot] = nodes;
        if (QUANTISED && !is_paired()) first_records.word[slot] = records;
    }

    uint next = of.x + of.y + place_in_next_level(level, inner);
    if (is_there) {
        uint rank = 0;
        for (uint s = 0; s < WIDTH; ++s) {
            uvec3 child = child_at(in_slot[s]);
            if (child.x == NO_CHILD) continue;
            if (child.z == 0 && next < capacity) opened.node[next++] = Opened(child.y, slot << 3 | rank);
            if (child.z == 0 || is_long(child.z)) rank++;
        }
    }
}

// One workgroup: the root as the only node of the first level.
void reset() {
    Header header = source.header;
    bool there_is = can_be_collapsed(header);
    for (uint l = gl_LocalInvocationIndex; l < LEVELS_AT_MOST; l += gl_WorkGroupSize.x) {
        levels.count[l] = l == 0 && there_is ? 1 : 0;
    }
    if (gl_LocalInvocationIndex == 0) {
        levels.first[0] = 0;
        levels.end = 0;
    }
    // A tree that is a leaf has no slot: the first one then stands for it.
    if (gl_LocalInvocationIndex == 0) opened.node[0] = Opened(is_inner(header.root) ? header.root.index : 0, 0);
}

// One workgroup: the nodes of several levels, as far as there are any.
void open_levels(uint first, uint end) {
    for (uint l = first; l < end; ++l) {
        uvec2 of = opened_of(l);
        if (of.y == 0) break;
        for (uint i = gl_LocalInvocationIndex; i - gl_LocalInvocationIndex < of.y; i += gl_WorkGroupSize.x) open(i, of, l);
        if (gl_LocalInvocationIndex == 0) note_end(l, of.x + of.y);
        next_phase();
    }
}
#endif
