// Children in slots by the octants that they lie in: the twin of `octant_slots` in src/bvh/twin/wide.rs, which says why.
#ifndef HEDGEROW_BVH_WIDE_OCTANTS
#define HEDGEROW_BVH_WIDE_OCTANTS
#include "bvh/wide/collapse.glsl"

// A quarter of the sum of the corners of each child.
vec3 open_middle[8];

vec3 quarter_middle(vec3 lo, vec3 hi) {
    precise vec3 middle = 0.25 * lo + 0.25 * hi;
    return middle;
}

vec3 middle_of_child(uint i) {
    if (!IN_REGISTERS) return open_middle[i];
    vec3 middle = vec3(0);
    for (uint k = 0; k < 8; ++k) middle = k == i ? open_middle[k] : middle;
    return middle;
}

// The slots of the `count` children of open_middle, `centre` being that of their node: `in_slot` gives the child in each, 8 for none.
void octant_slots(uint count, vec3 centre, out uint in_slot[8]) {
    uint left = (1u << count) - 1u;
    float distances[8];
    for (uint i = 0; i < (IN_REGISTERS ? 8 : count); ++i) {
        precise vec3 from = abs(open_middle[i] - centre);
        precise float far = from.x + from.y + from.z;
        distances[i] = far;
    }
    [[unroll]] for (uint s = 0; s < 8; ++s) in_slot[s] = 8;
    for (uint round = 0; round < count; ++round) {
        uint farthest = 8;
        float distance = -1.0;
        for (uint i = 0; i < (IN_REGISTERS ? 8 : count); ++i) {
            if ((left >> i & 1u) != 0u && distances[i] > distance) {
                distance = distances[i];
                farthest = i;
            }
        }
        left &= ~(1u << farthest);
        precise vec3 from = middle_of_child(farthest) - centre;
        uint best = 8;
        float most = 0.0;
        // Not unrolled here: where shaderc does it, the copies of what is `precise` are not.
        for (uint s = 0; s < 8; ++s) {
            vec3 towards = vec3((s & 1u) != 0u ? from.x : -from.x, (s & 2u) != 0u ? from.y : -from.y, (s & 4u) != 0u ? from.z : -from.z);
            precise float gain = towards.x + towards.y + towards.z;
            if (in_slot[s] == 8 && (best == 8 || gain > most)) {
                most = gain;
                best = s;
            }
        }
        if (IN_REGISTERS) {
            for (uint s = 0; s < 8; ++s) in_slot[s] = s == best ? farthest : in_slot[s];
        } else {
            in_slot[best] = farthest;
        }
    }
}
#endif
