// A property of each of some structures, 64 bits each. src/accel/properties.rs names them and says what they are.
//
// reads   the headers of structures[0..count]
// writes  results[0..count]
// needs   one barrier before and after; any subgroup size
#version 460
#include "accel/serialized.glsl"

const uint COMPACTED_SIZE = 0;
const uint SERIALIZED_SIZE = 1;
const uint BOTTOM_LEVEL_POINTERS = 2;
const uint SIZE = 3;
const uint NODE_COUNT = 4;
const uint SAH = 5;
const uint SAH_GROWTH = 6;
const uint STATUS = 7;

layout(push_constant, scalar) uniform PropertiesArguments {
    Pairs results;
    uint property;
    uint count;
    uvec2 structures[14];
};

float ratio(float a, float b) {
    return b > 0.0 ? a / b : 0.0;
}

// As Header::sah and Header::sah_growth.
float sah_of(Header header) {
    precise vec3 e = header.root.hi * header.area_scale - header.root.lo * header.area_scale;
    precise float area = e.x * e.y + e.y * e.z + e.z * e.x;
    return ratio(header.cost, area);
}

float sah_growth_of(Header header) {
    return ratio(sah_of(header), ratio(header.built_cost, header.built_area));
}

uvec2 property_of(Header header) {
    switch (property) {
    case COMPACTED_SIZE: return structure_bytes(compacted(header));
    case SERIALIZED_SIZE: return serialized_bytes(header);
    case BOTTOM_LEVEL_POINTERS: return uvec2(handle_count(header), 0);
    case SIZE: return structure_bytes(header);
    case NODE_COUNT: return uvec2(header.inner_nodes, 0);
    case SAH: return uvec2(floatBitsToUint(sah_of(header)), 0);
    case SAH_GROWTH: return uvec2(floatBitsToUint(sah_growth_of(header)), 0);
    case STATUS: return uvec2(header.status, 0);
    }
    return uvec2(0);
}

void main() {
    uint i = invocation_number();
    if (i >= count) return;
    Header header = Structure(structures[i]).header;
    // If it is not a structure: the properties of the empty structure that a copy of it becomes.
    results.pair[i] = property_of(is_structure(header) ? header : header_of_wrong_version());
}
