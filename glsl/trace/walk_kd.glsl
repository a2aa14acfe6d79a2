// One ray on its way through a kd-tree, step by step: the twin of src/trace/kd_host.rs, visit for visit, which says why no hit is
// lost and no cell visited twice.
//
// A shader may define, as constants or specialisation constants, before it includes this file:
//
// - HEDGEROW_KD_CAPACITY, the cells that may wait on the stack: KD_MAX_DEPTH, unless defined, is a full stack, 0 kd-restart;
// - HEDGEROW_KD_PUSH_DOWN, whether the way down begins again below the root, where nothing waits above; false unless defined.
#ifndef HEDGEROW_TRACE_WALK_KD
#define HEDGEROW_TRACE_WALK_KD
#include "kdtree/layout.glsl"
#include "trace/nearest.glsl"

#ifndef HEDGEROW_KD_CAPACITY
#define HEDGEROW_KD_CAPACITY KD_MAX_DEPTH
#endif
#ifndef HEDGEROW_KD_PUSH_DOWN
#define HEDGEROW_KD_PUSH_DOWN false
#endif

// Every cell that waits is on the stack: nothing is found again, and no trail is needed to find it.
const bool HEDGEROW_KD_FULL = HEDGEROW_KD_CAPACITY >= KD_MAX_DEPTH;
// In place of the triangles that are left of a leaf: nothing at hand, take what waits.
const uint HEDGEROW_KD_NOTHING = 0xffffffffu;

// A stack of few cells lies in registers, each cell in one of its own and moved on when another comes before it: no memory
// is indexed, which CPUs do lane by lane (short-4 takes 0.6 to 0.7 of the time so). A larger one is a ring in private memory, which
// lavapipe indexes a little faster than shared memory.
const uint HEDGEROW_KD_REGISTERS = 8;
const bool HEDGEROW_KD_IN_REGISTERS = HEDGEROW_KD_CAPACITY <= HEDGEROW_KD_REGISTERS;
uvec4 hedgerow_kd_ring[HEDGEROW_KD_IN_REGISTERS ? 1 : HEDGEROW_KD_CAPACITY];

layout(buffer_reference, scalar, buffer_reference_align = 4) nonprivate buffer HedgerowKdReferences { uint record[]; };

// What all rays need of a tree. Indices are cut off at the last of each part: a structure that was overwritten leads nowhere else.
struct HedgerowKdTree {
    KdStructure structure;
    HedgerowKdReferences references;
    Triangles records;
    uint last_node;
    uint last_reference;
    uint last_record;
    // More rounds than a ray's walk takes.
    uint rounds;
    // By how much besides its own margin a ray may miss its triangle.
    float margin;
    bool usable;
};

// The part of the ray that visits a node's cell, and where the ray enters the first of the cells that wait above. The level is a bit
// of the trail: the highest for the root, for each level below the next.
struct HedgerowKdPlace {
    uint node;
    float t_in;
    float t_out;
    float others;
    uvec2 level;
};

struct HedgerowKdWalk {
    HedgerowPreparedRay ray;
    // By what part of t, and by how much besides, the ray may miss its triangle.
    float slack;
    float margin;
    HedgerowKdPlace place;
    // The node of the place is at hand (`left` is 0), or the next reference and how many are left of its leaf, or NOTHING.
    uint left;
    uint reference;
    // Of each level on the way down whether no child waits there.
    uvec2 trail;
    // Where the way down begins again, and whether nothing waits above the place.
    HedgerowKdPlace restart;
    bool push_down;
    // How many cells wait on the stack. In registers what has waited shortest is the first; in the ring the next is put at `top`.
    uint waiting;
    uint top;
    uvec4 stack[HEDGEROW_KD_REGISTERS];
    uint rounds;
    float best;
    HedgerowHit hit;
    // Inner nodes visited, triangles tested, leaves visited.
    uvec3 work;
};

// If `puts`, the cell waits on the stack; if the stack is full, in place of the cell that has waited longest.
void hedgerow_kd_put(bool puts, uint node, float t_in, float t_out, float others, inout HedgerowKdWalk walk) {
    if (HEDGEROW_KD_CAPACITY == 0u) return;
    uvec4 entry = uvec4(node, floatBitsToUint(t_in), floatBitsToUint(t_out), floatBitsToUint(others));
    if (HEDGEROW_KD_IN_REGISTERS) {
#define HEDGEROW_KD_MOVE(to, from) if (HEDGEROW_KD_CAPACITY > to) walk.stack[to] = puts ? walk.stack[from] : walk.stack[to];
        HEDGEROW_KD_MOVE(7, 6)
        HEDGEROW_KD_MOVE(6, 5)
        HEDGEROW_KD_MOVE(5, 4)
        HEDGEROW_KD_MOVE(4, 3)
        HEDGEROW_KD_MOVE(3, 2)
        HEDGEROW_KD_MOVE(2, 1)
        HEDGEROW_KD_MOVE(1, 0)
#undef HEDGEROW_KD_MOVE
        walk.stack[0] = puts ? entry : walk.stack[0];
        walk.waiting = min(walk.waiting + uint(puts), HEDGEROW_KD_CAPACITY);
    } else if (puts) {
        hedgerow_kd_ring[walk.top] = entry;
        walk.top = walk.top + 1u == HEDGEROW_KD_CAPACITY ? 0u : walk.top + 1u;
        walk.waiting = min(walk.waiting + 1u, HEDGEROW_KD_CAPACITY);
    }
}

// What has waited shortest; its level is not in the entry, the trail knows it.
HedgerowKdPlace hedgerow_kd_taken(inout HedgerowKdWalk walk) {
    walk.waiting--;
    uvec4 entry;
    if (HEDGEROW_KD_IN_REGISTERS) {
        entry = walk.stack[0];
#define HEDGEROW_KD_MOVE(to, from) if (HEDGEROW_KD_CAPACITY > from) walk.stack[to] = walk.stack[from];
        HEDGEROW_KD_MOVE(0, 1)
        HEDGEROW_KD_MOVE(1, 2)
        HEDGEROW_KD_MOVE(2, 3)
        HEDGEROW_KD_MOVE(3, 4)
        HEDGEROW_KD_MOVE(4, 5)
        HEDGEROW_KD_MOVE(5, 6)
        HEDGEROW_KD_MOVE(6, 7)
#undef HEDGEROW_KD_MOVE
    } else {
        walk.top = (walk.top == 0u ? HEDGEROW_KD_CAPACITY : walk.top) - 1u;
        entry = hedgerow_kd_ring[walk.top];
    }
    return HedgerowKdPlace(entry.x, uintBitsToFloat(entry.y), uintBitsToFloat(entry.z), uintBitsToFloat(entry.w), uvec2(0));
}

uvec2 hedgerow_kd_below(uvec2 level) {
    return uvec2(level.x >> 1, level.x << 31 | level.y >> 1);
}

// A node at this level is done: on to the deepest child that waits above it. False if none does.
bool hedgerow_kd_advance(uvec2 level, inout uvec2 trail) {
    if ((level.x & 0x80000000u) != 0u) return false;
    uvec2 parent = uvec2(level.x << 1 | level.y >> 31, level.y << 1);
    // Below, there may be the bit of a node from which no child was visited.
    uvec2 above = trail & (parent.y != 0u ? uvec2(0xffffffffu, -parent.y) : uvec2(-parent.x, 0u));
    uint carry, over;
    trail.y = uaddCarry(above.y, parent.y, carry);
    trail.x = uaddCarry(above.x, parent.x + carry, over);
    return over == 0u;
}

// Of the child where the trail has gone on: below the last bit of it.
uvec2 hedgerow_kd_level_of(uvec2 trail) {
    return hedgerow_kd_below(trail.y != 0u ? uvec2(0u, trail.y & -trail.y) : uvec2(trail.x & -trail.x, 0u));
}

HedgerowKdTree hedgerow_kd_tree(uvec2 address) {
    KdStructure structure = KdStructure(address);
    KdHeader header = structure.header;
    HedgerowKdTree tree;
    tree.structure = structure;
    tree.references = HedgerowKdReferences(kd_references_at(address, header.node_room));
    tree.records = Triangles(kd_records_at(address, header.node_room, header.reference_room));
    tree.last_node = max(header.node_count, 1u) - 1u;
    tree.last_reference = max(header.reference_count, 1u) - 1u;
    tree.last_record = max(header.active_count, 1u) - 1u;
    // A round visits a node, tests a triangle or takes what waits; behind a restart nodes are visited again, as many as levels.
    const uint VISITS = HEDGEROW_KD_FULL ? 2u : 2u * (KD_MAX_DEPTH + 1u);
    tree.rounds = min(header.node_count, 0x80000000u / VISITS) * VISITS + min(header.reference_count, KD_MAX_REFERENCES) + 4u;
    precise float margin = uintBitsToFloat((127u - 17u) << 23) * header.reach;
    tree.margin = margin;
    tree.usable = header.magic == MAGIC && header.kind == KIND_KD_TREE && header.node_count != 0u && header.active_count != 0u &&
                  header.reference_count != 0u && (header.status & STATUS_UNUSABLE) == 0u;
    return tree;
}

// The part of the ray whose hits may be in a cell; false if there is none.
bool hedgerow_kd_through(HedgerowPreparedRay ray, vec3 cell_lo, vec3 cell_hi, out float t_in, out float t_out) {
    const float GREATEST = uintBitsToFloat(0x7f7fffffu);
    precise vec3 lo = cell_lo - ray.origin;
    precise vec3 hi = cell_hi - ray.origin;
    vec3 farthest = max(abs(lo), abs(hi));
    precise float widened = ray.slack * max(max(farthest.x, farthest.y), farthest.z) + 2.0 * ray.margin;
    float slack = min(widened, GREATEST);
    precise vec3 a = (lo - slack) * ray.inverse;
    precise vec3 b = (hi + slack) * ray.inverse;
    vec3 near = min(a, b);
    vec3 far = max(a, b);
    t_in = max(max(near.x, near.y), max(near.z, ray.t_min));
    t_out = min(min(far.x, far.y), min(far.z, ray.t_max));
    return t_in <= t_out;
}

// At the root; a ray that cannot hit anything has nothing at hand and nothing that waits.
void hedgerow_kd_begin(HedgerowRay ray, HedgerowKdTree tree, out HedgerowKdWalk walk) {
    bool goes = hedgerow_prepare(ray, walk.ray) && tree.usable;
    vec3 size = abs(ray.direction);
    precise float slack = walk.ray.slack * max(max(size.x, size.y), size.z);
    precise float margin = tree.margin + 2.0 * walk.ray.margin;
    walk.slack = slack;
    walk.margin = margin;
    float t_in, t_out;
    bool through = hedgerow_kd_through(walk.ray, tree.structure.header.lo, tree.structure.header.hi, t_in, t_out);
    walk.place = HedgerowKdPlace(0u, t_in, t_out, HEDGEROW_INFINITY, uvec2(0x80000000u, 0u));
    walk.restart = walk.place;
    walk.left = goes && through ? 0u : HEDGEROW_KD_NOTHING;
    walk.reference = 0u;
    walk.trail = uvec2(0u);
    walk.push_down = HEDGEROW_KD_PUSH_DOWN;
    walk.waiting = 0u;
    walk.top = 0u;
    walk.rounds = tree.rounds;
    walk.best = walk.ray.t_max;
    walk.hit = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
    walk.work = uvec3(0u);
}

void hedgerow_kd_visit(KdNode node, inout HedgerowKdWalk walk) {
    const float GREATEST = uintBitsToFloat(0x7f7fffffu);
    HedgerowKdPlace place = walk.place;
    if (kd_is_leaf(node)) {
        walk.work.z++;
        walk.reference = node.second >> 2;
        walk.left = node.first;
        return;
    }
    walk.work.x++;
    uint axis = node.second & 3u;
    float inverse = axis == 0u ? walk.ray.inverse.x : axis == 1u ? walk.ray.inverse.y : walk.ray.inverse.z;
    float origin = axis == 0u ? walk.ray.origin.x : axis == 1u ? walk.ray.origin.y : walk.ray.origin.z;
    precise float widened = walk.slack * max(abs(place.t_in), abs(place.t_out)) + walk.margin;
    // With the sign of the direction.
    float slack = uintBitsToFloat(floatBitsToUint(min(widened, GREATEST)) | floatBitsToUint(inverse) & 0x80000000u);
    precise float plane = uintBitsToFloat(node.first) - origin;
    precise float near_end = (plane + slack) * inverse;
    precise float far_begin = (plane - slack) * inverse;
    float t_out = min(place.t_out, near_end);
    float t_in = max(place.t_in, far_begin);

    // The left child is the near one where the ray goes up.
    bool up = inverse > 0.0;
    uint first = node.second >> 4;
    uint right = first + ((node.second & 4u) == 0u ? 1u : 0u);
    bool enters_near = (node.second & (up ? 4u : 8u)) == 0u && place.t_in <= t_out;
    bool enters_far = (node.second & (up ? 8u : 4u)) == 0u && t_in <= place.t_out;
    // Where both were to be visited and no child waits, the near one has been.
    bool near_is_done = !HEDGEROW_KD_FULL && ((walk.trail.x & place.level.x) | (walk.trail.y & place.level.y)) != 0u;
    bool both = enters_near && enters_far && !near_is_done;
    bool to_far = enters_far && !both;
    uint near = up ? first : right;
    uint far = up ? right : first;
    hedgerow_kd_put(both, far, t_in, place.t_out, place.others, walk);
    walk.push_down = walk.push_down && !both;
    if (!both && !HEDGEROW_KD_FULL) walk.trail |= place.level;
    if (enters_near || enters_far) {
        walk.place.node = to_far ? far : near;
        walk.place.t_in = to_far ? t_in : place.t_in;
        walk.place.t_out = to_far ? place.t_out : t_out;
        walk.place.others = both ? min(place.others, t_in) : place.others;
        walk.place.level = hedgerow_kd_below(place.level);
        if (HEDGEROW_KD_PUSH_DOWN && walk.push_down) walk.restart = walk.place;
    }
    walk.left = (enters_near || enters_far) && walk.place.t_in <= walk.best ? 0u : HEDGEROW_KD_NOTHING;
}

void hedgerow_kd_test(Triangle triangle, bool any_hit, inout HedgerowKdWalk walk) {
    walk.work.y++;
    walk.reference++;
    walk.left = walk.left == 1u ? HEDGEROW_KD_NOTHING : walk.left - 1u;
    if (hit_nearer(walk.ray, triangle, any_hit, walk.best, walk.hit) && any_hit) walk.left = HEDGEROW_KD_NOTHING;
}

// Takes what waits, from the stack or by a way down that begins again; false at the end of the walk.
bool hedgerow_kd_go_on(bool any_hit, inout HedgerowKdWalk walk) {
    // Equally near is not enough: a primitive with a lower index may be there.
    if (walk.best < walk.place.others || any_hit && walk.hit.primitive != HEDGEROW_NONE) return false;
    if (HEDGEROW_KD_FULL) {
        if (walk.waiting == 0u) return false;
        walk.place = hedgerow_kd_taken(walk);
    } else {
        if (!hedgerow_kd_advance(walk.place.level, walk.trail)) return false;
        if (HEDGEROW_KD_CAPACITY > 0u && walk.waiting > 0u) {
            walk.place = hedgerow_kd_taken(walk);
            walk.place.level = hedgerow_kd_level_of(walk.trail);
            walk.push_down = false;
        } else {
            walk.place = walk.restart;
            walk.push_down = HEDGEROW_KD_PUSH_DOWN;
        }
    }
    walk.left = walk.place.t_in <= walk.best ? 0u : HEDGEROW_KD_NOTHING;
    return true;
}

// A round: nodes, a triangle, what waits, as far as there is one of them to take; false at the end of the walk.
bool hedgerow_kd_proceed(HedgerowKdTree tree, bool any_hit, inout HedgerowKdWalk walk) {
    if (walk.left == 0u) hedgerow_kd_visit(tree.structure.nodes[min(walk.place.node, tree.last_node)], walk);
    if (walk.left == 0u) hedgerow_kd_visit(tree.structure.nodes[min(walk.place.node, tree.last_node)], walk);
    if (walk.left != 0u && walk.left != HEDGEROW_KD_NOTHING) {
        uint record = tree.references.record[min(walk.reference, tree.last_reference)];
        hedgerow_kd_test(tree.records.triangle[min(record, tree.last_record)], any_hit, walk);
    }
    walk.rounds--;
    if (walk.rounds == 0u) return false;
    return walk.left != HEDGEROW_KD_NOTHING || hedgerow_kd_go_on(any_hit, walk);
}
#endif
