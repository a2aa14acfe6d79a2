// One query on its way through a top level and the structures below it: what trace/query.glsl is made of.
//
// The stack is one: the entries of the bottom-level structure at hand lie above those of the top level. Each round takes a step
// of each kind that there is to take (what waits, an instance, a node, a primitive): invocations that wait for each other's steps
// are fewer than with a loop for each kind. The steps are in trace/query_quantised.glsl, query_instances.glsl and query_primitives.glsl, and
// what was met is in query_meetings.glsl; nodes of two and the loop are here.
//
// A query that ends at its first hit keeps no distances, as nothing is nearer than the end of its ray until then; in a structure whose
// children are in order (bvh/child_order.glsl) it takes the left child first, wherever that is. What a query asks for is mostly known
// when its shader is compiled, and then nothing is left of the other way.
//
// There is no loop in the loop, which would cost a copy of what changes in it: what was taken and is too far costs a round. On lavapipe a
// query of one level in turn is 1.06 times as fast so, and one of two levels by itself 1.01 times. Nor is there a return in the middle of the
// loop or of a step, which shader compilers make a loop of one round of, whose writes are masked: queries through two levels are 1.09 times as
// fast without in the loop, and again without in the steps (docs/notes/rays.md).
//
// What is written in a branch or lives through the loop is a word, 1 or 0, and no bool. lavapipe keeps bools in bytes: for each of them that a branch
// may write, the mask of the lanes is packed, and a condition is unpacked. Queries of two levels are 1.03 times as fast so, in turn 1.06.
//
// Rays that meet nothing far of a top level begin at the node over what is near (src/bvh/far.rs).
//
// Structures are of nodes of two or of nodes of eight (bvh/wide.glsl), which are walked as trace/walk_quantised.glsl does, in either level
// beside each other. A shader may define HEDGEROW_FORMS, a constant or specialisation constant: which of them there are,
// HEDGEROW_NODES_OF_TWO or HEDGEROW_NODES_OF_EIGHT. Rays pass what is made of others. What nobody uses costs: on lavapipe a query in nodes
// of two takes 1.1 times as long where the shader could meet those of eight, too.
//
// A shader may define HEDGEROW_ONE_LEVEL, a constant or specialisation constant: where it is true, bottom-level structures are queried
// themselves, and nothing is left of the steps of a top level, which rays pass. On lavapipe rays are 1.1 to 1.2 times as fast so.
//
// A shader may define HEDGEROW_ALL_BUILT, a constant or specialisation constant: where it is true, no structure that is queried is null, and
// each was built over at least one primitive. Nothing asks for that then, where a ray begins and in each turn (trace/query_turns.glsl).
//
// Where flags that are known when the shader is compiled have hedgerowRayFlagsSkipAABB, nothing is left of boxes. Of triangles alone, on lavapipe,
// rays through two levels are 1.02 to 1.03 times as fast so.
#ifndef HEDGEROW_TRACE_QUERY_WALK
#define HEDGEROW_TRACE_QUERY_WALK
#include "bvh/layout.glsl"
#define HEDGEROW_LEVELS (2 * MAX_DEPTH * HEDGEROW_QUERIES)
#include "trace/geometry.glsl"
#include "trace/quantised_boxes.glsl"
#include "trace/quantised_slots.glsl"
#include "trace/query_loads.glsl"
#include "trace/ray.glsl"
#include "trace/slab.glsl"
#include "trace/stack.glsl"
#include "trace/triangle.glsl"

const uint hedgerowRayFlagsNone = 0u;
const uint hedgerowRayFlagsOpaque = 1u;
const uint hedgerowRayFlagsNoOpaque = 2u;
const uint hedgerowRayFlagsTerminateOnFirstHit = 4u;
const uint hedgerowRayFlagsSkipClosestHitShader = 8u;
const uint hedgerowRayFlagsCullBackFacingTriangles = 16u;
const uint hedgerowRayFlagsCullFrontFacingTriangles = 32u;
const uint hedgerowRayFlagsCullOpaque = 64u;
const uint hedgerowRayFlagsCullNoOpaque = 128u;
const uint hedgerowRayFlagsSkipTriangles = 256u;
const uint hedgerowRayFlagsSkipAABB = 512u;

// VkGeometryInstanceFlagsKHR.
const uint HEDGEROW_INSTANCE_CULL_DISABLE = 1u;
const uint HEDGEROW_INSTANCE_FLIP_FACING = 2u;
const uint HEDGEROW_INSTANCE_FORCE_OPAQUE = 4u;
const uint HEDGEROW_INSTANCE_FORCE_NO_OPAQUE = 8u;

const uint HEDGEROW_MET_NOTHING = 0u;
const uint HEDGEROW_MET_TRIANGLE = 1u;
const uint HEDGEROW_MET_BOX = 2u;

#ifndef HEDGEROW_ONE_LEVEL
#define HEDGEROW_ONE_LEVEL false
#endif

#ifndef HEDGEROW_ALL_BUILT
#define HEDGEROW_ALL_BUILT false
#endif

const uint HEDGEROW_NODES_OF_TWO = 1u;
const uint HEDGEROW_NODES_OF_EIGHT = 2u;
#ifndef HEDGEROW_FORMS
#define HEDGEROW_ALL_FORMS
#define HEDGEROW_FORMS (HEDGEROW_NODES_OF_TWO | HEDGEROW_NODES_OF_EIGHT)
#endif

// In place of a leaf's count: nothing at hand, take what waits.
const uint HEDGEROW_NOTHING = 0xffffffffu;
// As many nodes and records as a structure may have.
const uint HEDGEROW_MOST = 1u << 27;

// A shader that defines HEDGEROW_COUNTS_WORK finds in `work` how many nodes of the top level, instances, nodes below and primitives
// a query has met so far.
#ifdef HEDGEROW_COUNTS_WORK
#define HEDGEROW_COUNT(member) query.work.member += 1u
#else
#define HEDGEROW_COUNT(member)
#endif

// A shader that defines HEDGEROW_LINK_COUNTS, the name of a function `uvec2 f(uvec2 structure)` of its own, has counted what its rays
// do below each node of bottom-level structures: `entered` and `hits` of LinkCount in src/bvh/counts.rs, `work` is left as it is. The
// function gives the address of a structure's counts, which are added to, or 0 to have none. Where an instance begins there is no link.
// A hit counts at the link of its leaf alone: those of a node are those of the leaves below it. It counts when the query ends: at the
// first hit, where that ends it, or when hedgerowRayQueryProceed returns false.
#ifdef HEDGEROW_LINK_COUNTS
layout(buffer_reference, scalar, buffer_reference_align = 4) nonprivate buffer HedgerowCounts { uint word[]; };
const uint HEDGEROW_LINK_COUNT_WORDS = 3u;
const uint HEDGEROW_ENTERED = 0u;
const uint HEDGEROW_HITS = 1u;
const uint HEDGEROW_NO_LINK = 0xffffffffu;

struct HedgerowLink {
    uvec2 counts;   // of the structure
    uint link;      // 2 * slot + 1 for a right child
};

uint hedgerow_waiting_links[HEDGEROW_LEVELS];

void hedgerow_count(HedgerowLink at, uint which) {
    if (at.link == HEDGEROW_NO_LINK || all(equal(at.counts, uvec2(0)))) return;
    atomicAdd(HedgerowCounts(at.counts).word[HEDGEROW_LINK_COUNT_WORDS * at.link + which], 1u);
}
#endif

struct HedgerowMeeting {
    uint type;
    float t;
    float u;
    float v;
    uint record;              // in the bottom-level structure; of quantised triangles see trace/query_pairs.glsl
    uint primitive;           // of all geometries of the structure
    uint instance;            // record in the top level; without meaning where a bottom-level structure is queried
    uint is_front;
    uint is_opaque;
};

struct HedgerowRayQuery {
    HedgerowRay ray;
    uint flags;
    uint cull_mask;
    uvec2 top;                // the structure that is queried
    uint top_has_instances;
    uint top_slots;
    uint top_records;
    uint top_form;
    uint top_geometries;      // how many it has, if it is a bottom level
    uint floor;               // where its entries of the stack begin
    // The structure at hand, and the ray in its space: behind an instance not before a node is at hand, as another instance may be next.
    uvec2 structure;
    uint slots;
    uint records;
    uint form;
    uint is_prepared;
    HedgerowPreparedRay prepared;
    uint instance;            // record in the top level
    uint instance_flags;
    // Of quantised nodes: those of the one at hand that are nodes and that the ray has yet to enter, as an entry of the stack has them
    // (first of its nodes; where the ray enters the nearest but the next in a half, which slots are nodes, which places are left), and the
    // place of the next; its leaves, likewise; the bits of the axes in which the ray goes down; the slots that the ray may enter of the node
    // where it begins. In a top level `first_child` is the node itself, and its leaves are among its nodes.
    uint first_child;
    uint group;
    uint next;
    uint first_record;
    uvec2 counts;
    uint leaves;
    uint octant;
    uint begin_slots;
    // Where its entries of the stack begin, and whether it is below the one that is queried.
    uint bottom;
    uint is_below;
    // The node at hand (`left` is 0), or the next record and how many are left of its leaf, or NOTHING.
    uint index;
    uint left;
    uint level;
    // Rounds until the walk is given up, in the structure at hand and in the top level behind it.
    uint rounds;
    uint top_rounds;
    HedgerowMeeting candidate;
    HedgerowMeeting committed;  // as long as there is none, its t is the end of the ray
#ifdef HEDGEROW_COUNTS_WORK
    uvec4 work;
#endif
#ifdef HEDGEROW_LINK_COUNTS
    HedgerowLink at;
    HedgerowLink hit_at;
#endif
};

// Whether the structure that is queried is a top level; whether it is at hand; whether one below it is.
bool hedgerow_has_top(HedgerowRayQuery query) {
    return !HEDGEROW_ONE_LEVEL && query.top_has_instances != 0u;
}

bool hedgerow_is_in_top(HedgerowRayQuery query) {
    return !HEDGEROW_ONE_LEVEL && query.top_has_instances != query.is_below;
}

bool hedgerow_is_below(HedgerowRayQuery query) {
    return !HEDGEROW_ONE_LEVEL && query.is_below != 0u;
}

// Where the entries of the structure at hand begin in the stack.
uint hedgerow_bottom(HedgerowRayQuery query) {
    return HEDGEROW_ONE_LEVEL ? query.floor : query.bottom;
}

vec3 hedgerow_transformed(vec4 rows[3], vec4 p) {
    precise vec3 q = vec3(rows[0].x * p.x + rows[0].y * p.y + rows[0].z * p.z + rows[0].w * p.w,
                          rows[1].x * p.x + rows[1].y * p.y + rows[1].z * p.z + rows[1].w * p.w,
                          rows[2].x * p.x + rows[2].y * p.y + rows[2].z * p.z + rows[2].w * p.w);
    return q;
}

// Whether there are structures of this form.
bool hedgerow_meets(uint form) {
    return (HEDGEROW_FORMS & ((form & FORM_QUANTISED) != 0u ? HEDGEROW_NODES_OF_EIGHT : HEDGEROW_NODES_OF_TWO)) != 0u;
}

bool hedgerow_can_be_traced(Header header) {
    bool known = header.kind == KIND_TRIANGLES || header.kind == KIND_BOXES || header.kind == KIND_INSTANCES || is_quantised(header.kind);
    known = known && hedgerow_meets(form_of(header)) && !(HEDGEROW_ONE_LEVEL && has_instances(header.kind));
    return header.magic == MAGIC && known && header.active_count != 0u && (header.status & STATUS_UNUSABLE) == 0u;
}

// More rounds than the walk of a structure takes: each node is seen once, may wait once, and may have eight slots in which nothing comes;
// each record is seen once and may wait once. A structure that was overwritten may be a circle.
uint hedgerow_rounds(uint slots, uint records) {
    return 10u * min(slots, HEDGEROW_MOST) + 2u * min(records, HEDGEROW_MOST) + 4u;
}

// Whether the structure at hand is of boxes.
bool hedgerow_is_at_boxes(HedgerowRayQuery query) {
    return (query.flags & hedgerowRayFlagsSkipAABB) == 0u && (query.form & FORM_BOXES) != 0u;
}

// Of what a bottom-level structure holds.
bool hedgerow_skips(uint flags, uint form) {
    return (flags & ((form & FORM_BOXES) != 0u ? hedgerowRayFlagsSkipAABB : hedgerowRayFlagsSkipTriangles)) != 0u;
}

// The ray made ready for the tests, and whether it can hit anything.
//
// In a top level, boxes must hold what a ray hits in the space of an instance: a place that is off there by 64 units of rounding
// of the largest component of its distance (src/trace/slab.rs), which a rotation may make 3 times as many of it in the world; and
// as the ray went through the inverse of the transform, by a few units of its coordinates. Eight times the slack holds both. (A
// transform that stretches one axis against another makes as much more of it; what it does to boxes is in accel/world_box.glsl.)
bool hedgerow_prepare_for(bool instances, HedgerowRay ray, out HedgerowPreparedRay prepared) {
    bool goes = hedgerow_prepare(ray, prepared);
    if (instances) {
        prepared.slack *= 8.0;
        prepared.margin *= 8.0;
    }
    return goes;
}

bool hedgerow_ends_at_first_hit(HedgerowRayQuery query) {
    return (query.flags & hedgerowRayFlagsTerminateOnFirstHit) != 0u;
}

bool hedgerow_goes_left_first(HedgerowRayQuery query) {
    return hedgerow_ends_at_first_hit(query) && (query.form & FORM_LEFT_FIRST) != 0u;
}

bool hedgerow_is_quantised(HedgerowRayQuery query) {
    bool is_quantised = HEDGEROW_FORMS == HEDGEROW_NODES_OF_EIGHT || (query.form & FORM_QUANTISED) != 0u;
    return HEDGEROW_FORMS != HEDGEROW_NODES_OF_TWO && is_quantised;
}

// Of quantised nodes nothing is at hand.
void hedgerow_drop_group(inout HedgerowRayQuery query) {
    query.group = 0u;
    query.leaves = 0u;
}

// At a quantised node of a structure in whose space the ray goes in this direction; it may enter these slots.
void hedgerow_begin_quantised(inout HedgerowRayQuery query, vec3 direction, uint slots) {
    query.begin_slots = slots;
    uvec3 down = floatBitsToUint(direction) >> 31;
    query.octant = hedgerow_goes_left_first(query) ? 0u : down.x | down.y << 1 | down.z << 2;
}

// Nothing is at hand, and nothing waits.
void hedgerow_end(inout HedgerowRayQuery query) {
    query.left = HEDGEROW_NOTHING;
    hedgerow_drop_group(query);
    query.level = query.floor;
    query.bottom = query.floor;
    query.is_below = 0u;
}

// Whether the ray meets anything that is far, of boxes on these sides.
bool hedgerow_meets_far(HedgerowRayQuery query, FarBoxes far, uint sides) {
    bool meets = false;
    for (uint left = sides & (1u << FAR_SIDES) - 1u; left != 0u && !meets; left &= left - 1u) {
        FarBox b = far.box[findLSB(left)];
        hedgerow_enter(query.prepared, b.lo, b.hi, query.committed.t, meets);
    }
    return meets;
}

// What the ray begins at in the structure at hand: a node, or `count` records. What has no nodes begins at none, whatever its header says.
void hedgerow_begin_at(inout HedgerowRayQuery query, uint index, uint count) {
    query.index = index;
    query.left = count == 0u && query.slots == 0u ? HEDGEROW_NOTHING : count;
}

// The structure that is queried is at hand.
void hedgerow_take_top(inout HedgerowRayQuery query) {
    query.structure = query.top;
    query.slots = query.top_slots;
    query.records = query.top_records;
    query.form = query.top_form;
}

void hedgerow_begin(out HedgerowRayQuery query, uint slot, uvec2 structure, uint flags, uint cull_mask, HedgerowRay ray) {
    query.top_has_instances = 0u;
    query.top_slots = 0u;
    query.top_records = 0u;
    query.top_form = 0u;
    query.top_geometries = 0u;
    query.rounds = 0u;
    bool goes = false;
    uvec2 root = uvec2(0u, HEDGEROW_NOTHING), far = uvec2(0u);
    uint near = 0u, far_sides = 0u;
    if (HEDGEROW_ALL_BUILT || any(notEqual(structure, uvec2(0)))) {
        Header header = Structure(structure).header;
        query.top_has_instances = has_instances(header.kind) ? 1u : 0u;
        query.top_slots = header.node_slots;
        query.top_records = header.primitive_count;
        query.top_form = form_of(header);
        query.top_geometries = header.geometry_count;
        query.rounds = hedgerow_rounds(header.node_slots, header.primitive_count);
        root = uvec2(header.root.index, header.root.count);
        near = header.near_node;
        far_sides = header.far_sides;
        far = far_boxes_of(structure, header);
        // As in Vulkan, a mask without bits lets the ray meet nothing.
        goes = hedgerow_can_be_traced(header) && cull_mask != 0u;
    }
    const HedgerowMeeting nothing = HedgerowMeeting(HEDGEROW_MET_NOTHING, ray.t_max, 0.0, 0.0, 0u, 0u, 0u, 0u, 0u);
    query.ray = ray;
    query.flags = flags;
    query.cull_mask = cull_mask;
    query.top = structure;
    query.floor = 2u * MAX_DEPTH * slot;
    query.instance = 0u;
    query.instance_flags = 0u;
    query.candidate = nothing;
    query.committed = nothing;
#ifdef HEDGEROW_COUNTS_WORK
    query.work = uvec4(0u);
#endif
#ifdef HEDGEROW_LINK_COUNTS
    query.at = HedgerowLink(uvec2(0u), HEDGEROW_NO_LINK);
    query.hit_at = query.at;
#endif
    // Of a group nothing but that there is none.
    hedgerow_end(query);
    query.index = 0u;
    query.top_rounds = 0u;
    query.octant = 0u;
    query.begin_slots = ALL_SLOTS;
    hedgerow_take_top(query);
    bool skips = !hedgerow_is_in_top(query) && hedgerow_skips(flags, query.form);
    query.is_prepared = 1u;
    if (hedgerow_prepare_for(hedgerow_is_in_top(query), ray, query.prepared) && goes && !skips) {
        hedgerow_begin_at(query, root.x, root.y);
        if (hedgerow_is_quantised(query)) hedgerow_begin_quantised(query, ray.direction, ALL_SLOTS);
        bool may_begin_near = hedgerow_is_in_top(query) && near != 0u;
        if (may_begin_near && !hedgerow_meets_far(query, FarBoxes(far), far_sides)) query.index = near;
#ifdef HEDGEROW_LINK_COUNTS
        if (!hedgerow_is_in_top(query)) query.at.counts = HEDGEROW_LINK_COUNTS(structure);
#endif
    }
}

// Says again what is known of a query whatever it has met: where it comes from another round, compilers do not see that, and keep, test and write
// all of it. Of one level in turn rays are 1.01 to 1.03 times as fast on lavapipe.
void hedgerow_recall(inout HedgerowRayQuery query) {
    if (HEDGEROW_QUERIES == 1) query.floor = 0u;
    query.prepared.t_min = query.ray.t_min;
    query.prepared.t_max = query.ray.t_max;
    if (HEDGEROW_ONE_LEVEL) {
        query.top_has_instances = 0u;
        hedgerow_take_top(query);
        query.is_prepared = 1u;
        query.prepared.origin = query.ray.origin;
        query.prepared.slack = HEDGEROW_SLACK;
        query.instance = 0u;
        query.instance_flags = 0u;
        query.begin_slots = ALL_SLOTS;
        query.bottom = query.floor;
        query.is_below = 0u;
        query.top_rounds = 0u;
    }
}

// What counts at the end counts once.
void hedgerow_count_hit(inout HedgerowRayQuery query) {
#ifdef HEDGEROW_LINK_COUNTS
    hedgerow_count(query.hit_at, HEDGEROW_HITS);
    query.hit_at.link = HEDGEROW_NO_LINK;
#endif
}

#include "trace/query_meetings.glsl"

// Where the entry of this level lies in the stack. A structure that was overwritten may be a circle: what waits in nodes of two and has no place
// shares the last one. (On lavapipe one level of them in turn is 1.04 times as fast as with a test whether there is room, as those of eight have.)
uint hedgerow_place(HedgerowRayQuery query) {
    return HEDGEROW_FORMS == HEDGEROW_NODES_OF_EIGHT ? query.level : min(query.level, query.floor + 2u * MAX_DEPTH - 1u);
}

// What the ray enters at this distance waits.
void hedgerow_put_off(inout HedgerowRayQuery query, uint index, uint count, float enter) {
    if (hedgerow_ends_at_first_hit(query)) hedgerow_put_anyway(hedgerow_place(query), index, count);
    else hedgerow_put(hedgerow_place(query), HedgerowWaiting(index, count, enter));
    query.level++;
}

#include "trace/query_quantised.glsl"

// At a node of two, which was loaded.
void hedgerow_visit_node(inout HedgerowRayQuery query, Node node) {
#ifdef HEDGEROW_COUNTS_WORK
    if (hedgerow_is_in_top(query)) query.work.x += 1u;
    else query.work.z += 1u;
#endif
    Child a = node.left, b = node.right;
    bool enters_a, enters_b;
    float enter_a = hedgerow_enter(query.prepared, a.lo, a.hi, query.committed.t, enters_a);
    float enter_b = hedgerow_enter(query.prepared, b.lo, b.hi, query.committed.t, enters_b);
    bool b_first = enters_b && (!enters_a || (enter_b < enter_a && !hedgerow_goes_left_first(query)));
    if (enters_a && enters_b) {
#ifdef HEDGEROW_LINK_COUNTS
        hedgerow_waiting_links[hedgerow_place(query)] = 2u * query.index + (b_first ? 0u : 1u);
#endif
        hedgerow_put_off(query, b_first ? a.index : b.index, b_first ? a.count : b.count, b_first ? enter_a : enter_b);
    }
#ifdef HEDGEROW_LINK_COUNTS
    query.at.link = 2u * query.index + (b_first ? 1u : 0u);
    if (enters_a || enters_b) hedgerow_count(query.at, HEDGEROW_ENTERED);
#endif
    query.index = b_first ? b.index : a.index;
    query.left = enters_a || enters_b ? b_first ? b.count : a.count : HEDGEROW_NOTHING;
}

// Whether a node is at hand. The ray is ready for it then. A stale structure may name nodes that there are not: its last one is taken for those.
bool hedgerow_comes_to_node(inout HedgerowRayQuery query) {
    bool comes = query.left == 0u;
    query.index = comes ? min(query.index, query.slots - 1u) : query.index;
    if (!HEDGEROW_ONE_LEVEL && comes && query.is_prepared == 0u) {
        hedgerow_prepare_for(hedgerow_is_in_top(query), query.ray, query.prepared);
        query.is_prepared = 1u;
    }
    return comes;
}

void hedgerow_visit(inout HedgerowRayQuery query) {
    if (hedgerow_is_quantised(query)) hedgerow_visit_quantised(query, hedgerow_quantised_node_at(query.structure, query.index));
    else hedgerow_visit_node(query, hedgerow_node_at(query.structure, query.index));
}

// To the next record of the leaf, if it and they are there: a stale structure may name records that there are not.
void hedgerow_step(inout HedgerowRayQuery query) {
    query.index++;
    query.left = query.left == 1u || query.index >= query.records ? HEDGEROW_NOTHING : query.left - 1u;
}

#include "trace/query_instances.glsl"
#include "trace/query_primitives.glsl"

// What waits in a structure of nodes of two is at hand, if it is near enough.
void hedgerow_take_waiting(inout HedgerowRayQuery query, bool waits) {
    if (hedgerow_ends_at_first_hit(query)) {
        uvec2 waiting = hedgerow_taken_anyway(hedgerow_place(query));
        query.index = waiting.x;
        query.left = waits ? waiting.y : HEDGEROW_NOTHING;
    } else {
        HedgerowWaiting waiting = hedgerow_taken(hedgerow_place(query));
        query.index = waiting.index;
        // Equally far is not too far: an equally near hit that comes before may be there.
        query.left = waits && waiting.enter <= query.committed.t ? waiting.count : HEDGEROW_NOTHING;
    }
#ifdef HEDGEROW_LINK_COUNTS
    query.at.link = hedgerow_waiting_links[hedgerow_place(query)];
    if (query.left != HEDGEROW_NOTHING) hedgerow_count(query.at, HEDGEROW_ENTERED);
#endif
}

// To the group that is at hand or, if none is, to what waits; false at the end of the walk. Behind an instance it takes what waits above it.
// What was taken may be nothing: too far.
bool hedgerow_go_back(inout HedgerowRayQuery query) {
    bool is_at_group = hedgerow_is_quantised(query) && hedgerow_has_group(query);
    if (!is_at_group && query.level == hedgerow_bottom(query) && hedgerow_is_below(query)) hedgerow_leave_instance(query);
    bool waits = is_at_group || query.level != hedgerow_bottom(query);
    if (!is_at_group) {
        // Where nothing waits an entry is read that means nothing.
        query.level -= waits ? 1u : 0u;
        if (hedgerow_is_quantised(query)) hedgerow_take_entry(query, hedgerow_entry(hedgerow_place(query)), waits);
        else hedgerow_take_waiting(query, waits);
    }
    return waits;
}

// And to the next node of the group, unless leaves are at hand, which are left to the round.
bool hedgerow_go_on(inout HedgerowRayQuery query) {
    bool waits = hedgerow_go_back(query);
    if (hedgerow_is_quantised(query)) hedgerow_take_of_group(query);
    return waits;
}

bool hedgerow_has_record(HedgerowRayQuery query) {
    return query.left != 0u && query.left != HEDGEROW_NOTHING;
}

// To the end, or for at most so many rounds, each a step of each kind that there is to take; what is left of them. True if a candidate
// waits; `ends` where there is none and nothing is left to do. (As a member of the query it would cost all queries 1.07 of their time on
// lavapipe.)
bool hedgerow_proceed_for(inout HedgerowRayQuery query, inout uint most, const bool is_bounded, out bool ends) {
    uint is_over = 0u, waits = 0u;
    while ((is_over | waits) == 0u && query.rounds != 0u && (!is_bounded || most != 0u)) {
        hedgerow_recall(query);
        query.rounds--;
        if (is_bounded) most--;
        if (query.left == HEDGEROW_NOTHING) is_over = hedgerow_go_on(query) ? 0u : 1u;
        if (hedgerow_has_record(query) && hedgerow_is_in_top(query)) hedgerow_enter_instance(query);
        if (hedgerow_comes_to_node(query)) hedgerow_visit(query);
        if (hedgerow_is_quantised(query)) hedgerow_take_leaf(query);
        if (hedgerow_has_record(query) && !hedgerow_is_in_top(query)) waits = hedgerow_test(query);
    }
    if (is_over != 0u) hedgerow_count_hit(query);
    ends = is_over != 0u || waits == 0u && query.rounds == 0u;
    return waits != 0u;
}

bool hedgerow_proceed(inout HedgerowRayQuery query) {
    uint most = 0u;
    bool ends;
    return hedgerow_proceed_for(query, most, false, ends);
}
#endif
