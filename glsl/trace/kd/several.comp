// Traces rays through several kd-trees, one after the other: what does not move and what does, each in a tree of its own. A ray
// ends in each tree before the nearest hit in those before it, so that of equally near hits that in the earlier tree counts.
// The loop is that of trace/kd/single.comp.
//
// reads   structure, which is a table of KdTrees here; rays[first..count]
// writes  hits[first..count], primitives numbered from each tree's first; with COUNT_WORK also works[first..count]
// needs   a barrier (shader write -> shader read) before and after; any subgroup size
#version 460
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const bool ANY_HIT = false;
layout(constant_id = 2) const bool COUNT_WORK = false;
layout(constant_id = 3) const uint CAPACITY = 0;
layout(constant_id = 4) const bool PUSH_DOWN = false;
#define HEDGEROW_KD_CAPACITY CAPACITY
#define HEDGEROW_KD_PUSH_DOWN PUSH_DOWN

#include "trace/buffers.glsl"
#include "trace/walk_kd.glsl"

// src/trace/kd.rs. The first entry is the head: its `first` says how many follow, at least one.
struct TreeEntry {
    uvec2 structure;
    uint first;
    uint reserved;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Table { TreeEntry entry[]; };

void main() {
    Table table = Table(uvec2(structure));
    uint trees = table.entry[0].first;
    uint group_rays = gl_WorkGroupSize.x * rays_each;
    uint next = first + gl_WorkGroupID.x * group_rays + gl_LocalInvocationIndex;
    uint end = min(count, first + (gl_WorkGroupID.x + 1) * group_rays);

    HedgerowKdTree tree;
    // Where the tree lies. Addresses go round the loop and references are made of them in each round: a reference that is one tree's
    // or another's by the way it came (an OpPhi of pointers) kills SwiftShader.
    uvec2 nodes_at, references_at, records_at;
    HedgerowKdWalk walk;
    HedgerowRay ray;
    HedgerowHit nearest;
    uvec3 work;
    bool going = false;
    uint i;
    TreeEntry entry;
    // Trees that the ray has not been through.
    uint left = 0;
    while (true) {
        if (!going) {
            if (left == 0u) {
                if (next >= end) break;
                i = next;
                next += gl_WorkGroupSize.x;
                ray = rays.ray[i];
                nearest = HedgerowHit(HEDGEROW_INFINITY, HEDGEROW_NONE, 0.0, 0.0);
                work = uvec3(0);
                left = trees;
            }
            entry = table.entry[trees - left + 1u];
            tree = hedgerow_kd_tree(entry.structure);
            hedgerow_kd_begin(ray, tree, walk);
            nodes_at = entry.structure;
            references_at = uvec2(tree.references);
            records_at = uvec2(tree.records);
        }
        tree.structure = KdStructure(nodes_at);
        tree.references = HedgerowKdReferences(references_at);
        tree.records = Triangles(records_at);
        going = hedgerow_kd_proceed(tree, ANY_HIT, walk);
        if (!going) {
            left--;
            work += walk.work;
            if (walk.hit.primitive != HEDGEROW_NONE) {
                nearest = walk.hit;
                nearest.primitive += entry.first;
                ray.t_max = nearest.t;
                if (ANY_HIT) left = 0;
            }
            if (left == 0u) {
                hits.hit[i] = nearest;
                if (COUNT_WORK) works.work[i] = work;
            }
        }
    }
}
