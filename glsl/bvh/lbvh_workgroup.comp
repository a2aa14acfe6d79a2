// Builds of few triangles, each by one workgroup that does all phases: two builds a dispatch, or as many as a table in memory has.
// See bvh/lbvh.glsl for the phases' contracts.
//
// reads   the triangles; the table, where there is one
// writes  the structures; scratch memory of each build
// needs   nothing of other workgroups; subgroups of any size; workgroups of whole subgroups
#version 460
#define HEDGEROW_BUILD_BY_ONE_WORKGROUP
#include "bvh/lbvh.glsl"
#include "bvh/encode/alone.glsl"

// The twin of `Small` in src/bvh/lbvh_workgroup.rs.
struct Small {
    uvec2 vertices;
    uvec2 indices;
    uvec2 transform;
    uvec2 structure;
    uvec2 scratch;
    uint vertex_stride;
    uint vertex_count;
    uint formats;
    uint primitive_count;
};

layout(push_constant, scalar) uniform BuildAloneArguments {
    Small builds[2];
    float step_cost;
    float test_cost;
    uint codes_and_flags;   // codes, collapses << 25, build flags << 26: push constants are full
    uint state_bytes;       // and IN_TABLE
} given;

// In `state_bytes`: all builds lie in a table, whose address is in the place of the first one's vertices.
const uint IN_TABLE = 1u << 31;

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Table {
    Small builds[];
};

Small build_of(uint number) {
    if ((given.state_bytes & IN_TABLE) != 0u) return Table(given.builds[0].vertices).builds[number];
    return given.builds[number];
}

// The next part of the scratch memory.
uint take(inout uint at, uint bytes) {
    uint begin = at;
    at += (bytes + 15u) / 16u;
    return begin;
}

// As src/bvh/scratch.rs plans them for a build by one workgroup.
void plan_parts(uint state_bytes) {
    uint at = 0u, sorted = passes & 1u, word_bytes = 4u * primitive_count, key_bytes = KEY_WORDS * word_bytes;
    take(at, state_bytes);
    parts.values[sorted] = take(at, word_bytes);
    parts.keys[sorted] = take(at, key_bytes);
    parts.ends = take(at, word_bytes);
    uint behind_ends = at;
    parts.keys[1u - sorted] = take(at, key_bytes);
    parts.values[1u - sorted] = take(at, word_bytes);
    parts.table = at;
    // Behind the sort.
    uint weight_bytes = HAS_WEIGHTS ? 3u * word_bytes : 0u;
    parts.child_costs[0] = take(behind_ends, word_bytes + weight_bytes);
    parts.child_costs[1] = take(behind_ends, word_bytes + weight_bytes);
}

void main() {
    Small build = build_of(group_number());
    vertices = build.vertices;
    indices = build.indices;
    transform = build.transform;
    structure_address = build.structure;
    vertex_stride = build.vertex_stride;
    vertex_count = build.vertex_count;
    formats = build.formats;
    primitive_count = build.primitive_count;
    scratch_address = build.scratch;
    code_kind = given.codes_and_flags & 0x1FFFFFFu;
    collapses = given.codes_and_flags >> 25 & 1u;
    build_flags = given.codes_and_flags >> 26;
    c_t = given.step_cost;
    c_i = given.test_cost;
    // A strip for each lane, or tiles.
    column_keys = PRIVATE_COUNTERS ? max((primitive_count + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x, 1u)
                                   : TILE_KEYS;
    passes = primitive_count < 2u ? 0u : (max(given_code_bits(), most_bits_by_spread()) + DIGIT_BITS - 1u) / DIGIT_BITS;
    plan_parts(given.state_bytes & ~IN_TABLE);

    encode_alone();
    uint tile = gl_WorkGroupSize.x * ITEMS;
    uint tiles = (primitive_count + tile - 1u) / tile;
    for (uint task = 0; task < tiles; ++task) lbvh_hierarchy(task);
}
