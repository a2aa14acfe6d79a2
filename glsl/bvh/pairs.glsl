// Pairs: of eight triangles that lie side by side in the input, two that share an edge are one leaf from the start, if the box around both
// is small enough. A tree over pairs has fewer leaves to sort and to merge, down to half of them. In the finished tree both are triangles of
// one leaf, and nothing else tells that they were a pair. src/bvh/twin/pairs.rs has the rule and is the twin.
//
//   load_block   reads the triangles of a block         writes the variables below
//   pair_block   reads and changes the variables        outputs the block's word: see PAIR_BITS
//
// bvh/encode.glsl finds pairs on the way to the bounds.
#ifndef HEDGEROW_BVH_PAIRS
#define HEDGEROW_BVH_PAIRS
#extension GL_EXT_control_flow_attributes : require
#include "bvh/build_state.glsl"
#include "bvh/sah.glsl"

// The most area of the box around both, as a part of the two triangles' own.
const float LARGEST_BOX = 0.9;

// Of the triangles of a block; after pairing, of each pair in the place of its first. Loops over them are unrolled, for arrays that are
// indexed by variables would lie in memory.
Box block_box[PAIR_BLOCK];
float block_area[PAIR_BLOCK];
uvec3 block_names[PAIR_BLOCK];   // of vertices
// A bit each: which are there and not the second of a pair, and which are the second.
uint block_firsts;
uint block_seconds;
uint block_word;
float block_scale;
// Of a triangle so far: the area of the box around it and the best partner, and how many places behind it that is; 0: there is none.
float partner_area;
uint partner_apart;

// Blocks of a tile, which has whole ones (src/bvh/encode.rs).
uint blocks_of_tile() {
    return gl_WorkGroupSize.x * ITEMS / PAIR_BLOCK;
}

// Which triangles of a block are the second of a pair, a bit each.
uint seconds_of_block(uint word) {
    uint all_set = word & word >> 1 & word >> 2 & word >> 3, seconds = 0u;
    [[unroll]] for (uint k = 0; k < PAIR_BLOCK; ++k) seconds |= (all_set >> PAIR_BITS * k & 1u) << k;
    return seconds;
}

// Vertices of the same bits have the same name. Others have it by chance, and rarely: then a pair shares no edge, which is no fault.
uint name_of(vec3 vertex) {
    uvec3 bits = floatBitsToUint(vertex);
    uint name = (bits.x ^ bits.x >> 15) * 0x9E3779B1u + bits.y;
    return (name ^ name >> 15) * 0x85EBCA77u + bits.z;
}

// Returns why triangles are left out.
uint load_block(Geometry g, uint block) {
    uint status = 0u;
    block_firsts = 0u;
    Box all = Box(vec3(uintBitsToFloat(0x7F7FFFFFu)), vec3(uintBitsToFloat(0xFF7FFFFFu)));
    for (uint k = 0; k < PAIR_BLOCK; ++k) {
        uint primitive = block * PAIR_BLOCK + k;
        Corners c = Corners(vec3(0), vec3(0), vec3(0));
        if (primitive < primitive_count) {
            uint why_not = load_corners(g, primitive, c);
            status |= why_not;
            if (why_not == 0u) {
                block_firsts |= 1u << k;
                all = Box(min(all.lo, box_around(c).lo), max(all.hi, box_around(c).hi));
            }
        }
        Box b = box_around(c);
        uvec3 names = uvec3(name_of(c.v0), name_of(c.v1), name_of(c.v2));
        [[unroll]] for (uint i = 0; i < PAIR_BLOCK; ++i) {
            if (i == k) {
                block_box[i] = b;
                block_names[i] = names;
            }
        }
    }
    block_scale = block_firsts == 0u ? 1.0 : area_scale_for(all, all);
    return status;
}

// Whether so many vertices of the one are the other's that they share an edge.
bool share_an_edge(uvec3 names, uvec3 others) {
    uvec3 found = uvec3(any(equal(names, others.xxx)), any(equal(names, others.yyy)), any(equal(names, others.zzz)));
    return found.x + found.y + found.z >= 2u;
}

void find_area(uint i) {
    block_area[i] = scaled_half_area(block_box[i], block_scale);
}

// Shows triangle `i` one behind it. Without a branch: see bvh/hploc/by_one.glsl.
void show(uint i, uint j) {
    Box b = Box(min(block_box[i].lo, block_box[j].lo), max(block_box[i].hi, block_box[j].hi));
    float area = scaled_half_area(b, block_scale);
    precise float largest = LARGEST_BOX * (block_area[i] + block_area[j]);
    bool are_there = (block_firsts >> i & block_firsts >> j & 1u) != 0u;
    bool is_better = all(bvec4(are_there, share_an_edge(block_names[i], block_names[j]), area <= largest, area < partner_area));
    partner_area = mix(partner_area, area, is_better);
    partner_apart = mix(partner_apart, j - i, is_better);
}

void begin_triangle() {
    partner_area = uintBitsToFloat(0x7F800000u);
    partner_apart = 0u;
}

// Makes a pair of triangle `i` and the best that it was shown, if there is one.
void join(uint i) {
    bool has_partner = partner_apart != 0u;
    uint second = i + partner_apart;
    [[unroll]] for (uint j = 1; j < PAIR_BLOCK; ++j) {
        bvec3 is_it = bvec3(all(bvec2(has_partner, j == second)));
        block_box[i].lo = mix(block_box[i].lo, min(block_box[i].lo, block_box[j].lo), is_it);
        block_box[i].hi = mix(block_box[i].hi, max(block_box[i].hi, block_box[j].hi), is_it);
    }
    uint bit = uint(has_partner) << second;
    block_firsts &= ~bit;
    block_seconds |= bit;
    block_word |= partner_apart << PAIR_BITS * i | (has_partner ? SECOND_OF_PAIR : 0u) << PAIR_BITS * second;
    begin_triangle();
}

// Each triangle takes the best of those behind it that none before has taken. No loop: where shaderc unrolls one, the copies of what is
// `precise` are not.
uint pair_block() {
    block_seconds = 0u;
    block_word = 0u;
    find_area(0); find_area(1); find_area(2); find_area(3); find_area(4); find_area(5); find_area(6); find_area(7);
    begin_triangle();
    show(0, 1); show(0, 2); show(0, 3); show(0, 4); show(0, 5); show(0, 6); show(0, 7); join(0);
    show(1, 2); show(1, 3); show(1, 4); show(1, 5); show(1, 6); show(1, 7); join(1);
    show(2, 3); show(2, 4); show(2, 5); show(2, 6); show(2, 7); join(2);
    show(3, 4); show(3, 5); show(3, 6); show(3, 7); join(3);
    show(4, 5); show(4, 6); show(4, 7); join(4);
    show(5, 6); show(5, 7); join(5);
    show(6, 7); join(6);
    return block_word;
}
#endif
