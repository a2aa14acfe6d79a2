// The header for kd-trees that engines include: rays traced through our kd-trees from any shader.
//
//     #include "trace/kd_tree.glsl"                            // with glsl/ of this package as the include folder
//
//     HedgerowHit hit = hedgerowKdTreeClosestHit(address, origin, t_min, direction, t_max);
//     if (hit.primitive != HEDGEROW_NONE) shade(hit.t, hit.primitive, hit.u, hit.v);
//
// A shader that defines HEDGEROW_KD_CAPACITY and HEDGEROW_KD_PUSH_DOWN before has another traversal than a full stack
// (trace/walk_kd.glsl): a short stack of up to 8 cells lies in registers and is faster. One that traces several rays of a tree makes a
// HedgerowKdTree once, by hedgerow_kd_tree(address). Primitives count through all geometries: hedgerowKdTreeGeometry returns which.
//
// reads   the structure: the caller places a barrier behind its build (shader write -> shader read)
// needs   the features of gpu::requirements(); no descriptors, no shared memory, any subgroup size
//
// A triangle is hit when t_min < t < t_max; of equally near ones the lower primitive. A walk ends for every input: rays that are no
// rays (NaN, infinite, no direction) hit nothing, and nothing is hit in memory that holds no kd-tree, or an empty one, or one whose status says that it is unusable.
#ifndef HEDGEROW_TRACE_KD_TREE
#define HEDGEROW_TRACE_KD_TREE

// Names that are the includer's: until the end of this file.
#include "bvh/names.glsl"
#define KdHeader HedgerowKdHeader
#define KdNode HedgerowKdNode
#define KdStructure HedgerowKdStructure
#define KIND_KD_TREE HEDGEROW_KIND_KD_TREE
#define KD_MAX_DEPTH HEDGEROW_KD_MAX_DEPTH
#define KD_MAX_NODES HEDGEROW_KD_MAX_NODES
#define KD_MAX_REFERENCES HEDGEROW_KD_MAX_REFERENCES
#define KD_LEAF HEDGEROW_KD_LEAF
#define kd_is_leaf hedgerow_kd_is_leaf
#define kd_leaf hedgerow_kd_leaf
#define kd_inner hedgerow_kd_inner
#define kd_references_at hedgerow_kd_references_at
#define kd_records_at hedgerow_kd_records_at
#define kd_geometries_at hedgerow_kd_geometries_at
#define hit_nearer hedgerow_hit_nearer
#include "trace/geometry.glsl"
#include "trace/walk_kd.glsl"

// Either hit, through a tree that was made ready.
HedgerowHit hedgerow_kd_trace(HedgerowKdTree tree, HedgerowRay ray, bool any_hit) {
    HedgerowKdWalk walk;
    hedgerow_kd_begin(ray, tree, walk);
    while (hedgerow_kd_proceed(tree, any_hit, walk)) {}
    return walk.hit;
}

// The nearest hit; `primitive` is HEDGEROW_NONE without one.
HedgerowHit hedgerowKdTreeClosestHit(uvec2 structure, vec3 origin, float t_min, vec3 direction, float t_max) {
    return hedgerow_kd_trace(hedgerow_kd_tree(structure), HedgerowRay(origin, t_min, direction, t_max), false);
}

// Whether there is a hit at all.
bool hedgerowKdTreeAnyHit(uvec2 structure, vec3 origin, float t_min, vec3 direction, float t_max) {
    HedgerowRay ray = HedgerowRay(origin, t_min, direction, t_max);
    return hedgerow_kd_trace(hedgerow_kd_tree(structure), ray, true).primitive != HEDGEROW_NONE;
}

// The geometry that a primitive is of: its index, its first primitive, its flags.
HedgerowGeometry hedgerowKdTreeGeometry(uvec2 structure, uint primitive) {
    KdHeader header = KdStructure(structure).header;
    if (header.geometry_count <= 1u) return HedgerowGeometry(0u, 0u, header.geometry_flags & 0xffu);
    GeometryTable table = kd_geometries_at(structure, header.node_room, header.reference_room, header.record_room);
    return hedgerow_geometry_in(table, header.geometry_count, primitive);
}

#include "bvh/names_end.glsl"
#undef KdHeader
#undef KdNode
#undef KdStructure
#undef KIND_KD_TREE
#undef KD_MAX_DEPTH
#undef KD_MAX_NODES
#undef KD_MAX_REFERENCES
#undef KD_LEAF
#undef kd_is_leaf
#undef kd_leaf
#undef kd_inner
#undef kd_references_at
#undef kd_records_at
#undef kd_geometries_at
#undef hit_nearer
#endif
