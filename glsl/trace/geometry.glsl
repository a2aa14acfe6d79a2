// Which geometry a primitive is of, for shaders that trace a structure.
#ifndef HEDGEROW_TRACE_GEOMETRY
#define HEDGEROW_TRACE_GEOMETRY
#include "bvh/layout.glsl"

struct HedgerowGeometry {
    uint index;
    uint first;     // its first primitive
    uint flags;     // VkGeometryFlagsKHR
};

// Of several.
HedgerowGeometry hedgerow_geometry_in(GeometryTable table, uint count, uint primitive) {
    uint at = geometry_index_of(table, count, primitive);
    return HedgerowGeometry(at, table.entry[at].first, table.entry[at].flags);
}
#endif
