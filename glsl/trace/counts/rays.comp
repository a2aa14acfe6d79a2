#version 460
// Walks every `stride`-th ray through the tree and tallies where it goes: see trace/counts.glsl for the contract.
//
// As traced, the walk is that of trace/walk.glsl, visit for visit. Exhaustive, a ray goes on after a hit, through all that it meets
// between its limits. What waits is a link and where the ray enters it. The loop ends as a tracer's does: a tree has an end.
//
// needs  any subgroup size
// First, for it has the workgroup's size, and the stack's arrays have it, too.
#include "gpu/pass.glsl"
layout(constant_id = 1) const uint WALK = 0;
layout(constant_id = 3) const uint SHARED_LEVELS = 0;
#define HEDGEROW_SHARED_LEVELS SHARED_LEVELS
#include "trace/counts.glsl"
#include "trace/nearest.glsl"
#include "trace/ray.glsl"
#include "trace/slab.glsl"
#include "trace/stack.glsl"

// CountedWalk in src/trace/counts.rs.
const uint CLOSEST_HIT = 0;
const uint ANY_HIT = 1;
const uint EXHAUSTIVE = 2;

// In place of a leaf's count: nothing at hand, take what waits.
const uint NOTHING = 0xFFFFFFFFu;

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Rays { HedgerowRay ray[]; };

layout(push_constant, scalar) uniform CountRaysArguments {
    Structure structure;
    Rays rays;
    Words tallies;
    uint first;       // ray
    uint stride;      // to the next one that is counted
    uint begin;       // of those that are counted, the first of this dispatch
    uint count;       // how many are counted
    uint rays_each;
};

struct CountedRay {
    HedgerowPreparedRay ray;
    float best;
    HedgerowHit hit;
    // The node at hand (`left` is 0), or the next triangle and how many are left of its leaf, or NOTHING.
    uint index;
    uint left;
    // The leaf at hand, and whether the ray has hit something in it.
    uint link;
    bool has_hit_here;
    // How many links wait.
    uint level;
    // Whether the ray has hit something; since then, the lowest level at which it took what waited, and the node whose child that was:
    // there the ways part.
    bool has_hit;
    uint lowest_level;
    uint parting;
};

void go_into(uint link, Child child, inout CountedRay walk) {
    atomicAdd(tallies.word[tally_of(link >> 1) + (link & 1u)], 1u);
    walk.link = link;
    walk.index = child.index;
    walk.left = child.count;
    walk.has_hit_here = false;
}

float waiting_at(Child child, float enter) {
    return child.count < HEDGEROW_LONG_LEAF ? enter : -HEDGEROW_INFINITY;
}

void visit(uint slot, inout CountedRay walk) {
    Node node = structure.nodes[slot];
    bool enters_left, enters_right;
    float left = hedgerow_enter(walk.ray, node.left.lo, node.left.hi, walk.best, enters_left);
    float right = hedgerow_enter(walk.ray, node.right.lo, node.right.hi, walk.best, enters_right);
    bool right_first = enters_right && (!enters_left || right < left);
    uint links = 2u * slot;
    if (enters_left && enters_right) {
        uint waits = right_first ? links : links + 1u;
        float enter = right_first ? waiting_at(node.left, left) : waiting_at(node.right, right);
        hedgerow_put_entry(walk.level, uvec2(waits, floatBitsToUint(enter)));
        walk.level++;
    }
    walk.left = NOTHING;
    if (right_first) go_into(links + 1u, node.right, walk);
    else if (enters_left) go_into(links, node.left, walk);
}

// Takes the last link that waits.
void go_on(inout CountedRay walk) {
    walk.level--;
    uvec2 entry = hedgerow_entry(walk.level);
    uint link = entry.x, slot = link >> 1;
    if (walk.level < walk.lowest_level) {
        walk.lowest_level = walk.level;
        walk.parting = slot;
    }
    // Equally far is not too far, as in trace/walk.glsl.
    if (uintBitsToFloat(entry.y) > walk.best) return;
    Node node = structure.nodes[slot];
    if ((link & 1u) != 0u) go_into(link, node.right, walk);
    else go_into(link, node.left, walk);
}

void tally_hit(inout CountedRay walk) {
    if (walk.has_hit_here) return;
    atomicAdd(tallies.word[tally_of(walk.link >> 1) + TALLY_HITS + (walk.link & 1u)], 1u);
    if (walk.has_hit) atomicAdd(tallies.word[tally_of(walk.parting) + TALLY_TWICE], 1u);
    walk.has_hit = true;
    walk.has_hit_here = true;
    walk.lowest_level = NOTHING;
}

void test(Triangle triangle, inout CountedRay walk) {
    walk.index++;
    walk.left = walk.left == 1u ? NOTHING : walk.left - 1u;
    if (!hit_nearer(walk.ray, triangle, false, walk.best, walk.hit)) return;
    tally_hit(walk);
    if (WALK == EXHAUSTIVE) {
        walk.best = walk.ray.t_max;
        walk.hit.primitive = HEDGEROW_NONE;
    }
    if (WALK == ANY_HIT) {
        walk.left = NOTHING;
        walk.level = 0;
    }
}

void main() {
    Triangles triangles = triangles_of(structure);
    Header header = structure.header;
    // A root that is a leaf hangs nowhere.
    bool usable = header.active_count != 0u && (header.status & STATUS_UNUSABLE) == 0u && header.root.count == 0u;
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = begin + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = usable ? min(count, begin + (gl_WorkGroupID.x + 1) * group_rays) : 0u;

    CountedRay walk;
    walk.left = NOTHING;
    walk.level = 0;
    while (true) {
        if (walk.left == NOTHING && walk.level == 0u) {
            if (next >= end) break;
            bool goes = hedgerow_prepare(rays.ray[first + next * stride], walk.ray);
            next += gl_WorkGroupSize.x;
            walk.best = walk.ray.t_max;
            walk.hit = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
            walk.has_hit = false;
            walk.lowest_level = NOTHING;
            walk.index = header.root.index;
            walk.left = goes ? 0u : NOTHING;
        } else if (walk.left == NOTHING) {
            go_on(walk);
        }
        if (walk.left == 0u) visit(walk.index, walk);
        if (walk.left != 0u && walk.left != NOTHING) test(triangles.triangle[walk.index], walk);
    }
}
