// What a tree is built over, whatever SOURCE it comes from: the box of a primitive, and the record of it in the structure.
#ifndef HEDGEROW_BVH_PRIMITIVES
#define HEDGEROW_BVH_PRIMITIVES
#include "bvh/geometry.glsl"
#include "bvh/instances.glsl"

uint kind_of_records() {
    return SOURCE == SOURCE_ENTRIES ? KIND_INSTANCES
                                    : SOURCE == SOURCE_BOXES || SOURCE == SOURCE_SEVERAL_BOXES ? KIND_BOXES : KIND_TRIANGLES;
}

bool has_records() {
    return SOURCE == SOURCE_GEOMETRIES || SOURCE == SOURCE_SEVERAL_BOXES;
}

// Geometries that are given, without the record that may end them.
uint count_geometries(Geometry g) {
    if (!has_records()) return 1;
    bool has_end = g.vertex_count > 0 && (flags_of(Geometries(g.vertices).geometry[g.vertex_count - 1]) & GEOMETRY_END) != 0u;
    return has_end ? g.vertex_count - 1 : g.vertex_count;
}

// The flags of all geometries in one word; where there are several, the structure's table is written.
uint write_geometries(Geometry g, uint count, GeometryTable table) {
    if (!has_records()) return SOURCE == SOURCE_ENTRIES ? 0 : flags_of(g) | flags_of(g) << 8;
    Geometries given = Geometries(g.vertices);
    uint all = 0xFF, any = 0;
    for (uint i = 0; i < count; ++i) {
        uint flags = flags_of(given.geometry[i]);
        if (count > 1) table.entry[i] = GeometryEntry(given.geometry[i].first, flags);
        all &= flags;
        any |= flags;
    }
    return all | any << 8;
}

shared uint flags_of_all;
shared uint flags_of_any;

// The same by the workgroup together, which all get what it returns.
uint write_geometries_together(Geometry g, uint count, GeometryTable table) {
    if (!has_records()) return write_geometries(g, count, table);
    if (gl_LocalInvocationIndex == 0) {
        flags_of_all = 0xFFu;
        flags_of_any = 0u;
    }
    barrier();
    Geometries given = Geometries(g.vertices);
    for (uint i = gl_LocalInvocationIndex; i < count; i += gl_WorkGroupSize.x) {
        uint flags = flags_of(given.geometry[i]);
        if (count > 1) table.entry[i] = GeometryEntry(given.geometry[i].first, flags);
        atomicAnd(flags_of_all, flags);
        atomicOr(flags_of_any, flags);
    }
    barrier();
    return flags_of_all | flags_of_any << 8;
}

// The box of a primitive; returns 0, or why it is left out: a status bit or INACTIVE.
uint load_box(Geometry g, uint primitive, out Box b) {
    uint why_not;
    if (SOURCE == SOURCE_ENTRIES) {
        Entry entry = Entries(g.vertices).entry[primitive];
        b = Box(entry.lo, entry.hi);
        why_not = entry.left_out;
    } else if (kind_of_records() == KIND_BOXES) {
        why_not = load_given_box(g, primitive, b);
    } else {
        Corners corners;
        why_not = load_corners(g, primitive, corners);
        b = box_around(corners);
    }
    return why_not;
}

// Writes the record of a primitive to its place, and outputs its box and, of a triangle, its corners. Returns as load_box does. One that
// is left out has a record of zeros.
uint write_record(uvec2 records, uint position, Geometry g, uint primitive, out Box b, out Corners c) {
    uint why_not;
    c = Corners(vec3(0), vec3(0), vec3(0));
    if (SOURCE == SOURCE_ENTRIES) {
        Entry entry = Entries(g.vertices).entry[primitive];
        Instances(records).instance[position] = record_of(entry);
        b = Box(entry.lo, entry.hi);
        why_not = entry.left_out;
    } else if (kind_of_records() == KIND_BOXES) {
        why_not = load_given_box(g, primitive, b);
        BoxRecords(records).box[position] = BoxRecord(b.lo, b.hi, primitive);
    } else {
        why_not = load_corners(g, primitive, c);
        Triangles(records).triangle[position] = Triangle(c.v0, c.v1, c.v2, primitive);
        b = box_around(c);
    }
    return why_not;
}
#endif
