// Children in slots by the octants that they lie in: the twin of `octant_slots` in src/bvh/wide/host.rs, which tells why.
#ifndef HEDGEROW_BVH_WIDE_OCTANTS
#define HEDGEROW_BVH_WIDE_OCTANTS
#include "bvh/wide_collapse.glsl"

// What names the children that are being put into slots.
uint open_name[8];

vec3 quarter_middle(vec3 lo, vec3 hi) {
    precise vec3 middle = 0.25 * lo + 0.25 * hi;
    return middle;
}

// The slots of the `count` children that open_name names: `in_slot` tells which is in each, 8 for none.
void octant_slots(uint count, out uint in_slot[8]) {
    vec3 offset[8];
    vec3 lo = uintBitsToFloat(uvec3(0x7F800000u)), hi = uintBitsToFloat(uvec3(0xFF800000u));
    for (uint i = 0; i < count; ++i) {
        Child child = child_named(open_name[i]);
        lo = min(lo, child.lo);
        hi = max(hi, child.hi);
        offset[i] = quarter_middle(child.lo, child.hi);
    }
    vec3 centre = quarter_middle(lo, hi);
    uint left = (1u << count) - 1u;
    for (uint s = 0; s < 8; ++s) in_slot[s] = 8;
    for (uint round = 0; round < count; ++round) {
        uint farthest = 8;
        float distance = -1.0;
        for (uint i = 0; i < count; ++i) {
            precise vec3 from = abs(offset[i] - centre);
            precise float far = from.x + from.y + from.z;
            if ((left >> i & 1u) != 0u && far > distance) {
                distance = far;
                farthest = i;
            }
        }
        left &= ~(1u << farthest);
        precise vec3 from = offset[farthest] - centre;
        uint best = 8;
        float most = 0.0;
        for (uint s = 0; s < 8; ++s) {
            vec3 towards = vec3((s & 1u) != 0u ? from.x : -from.x, (s & 2u) != 0u ? from.y : -from.y, (s & 4u) != 0u ? from.z : -from.z);
            precise float gain = towards.x + towards.y + towards.z;
            if (in_slot[s] == 8 && (best == 8 || gain > most)) {
                most = gain;
                best = s;
            }
        }
        in_slot[best] = farthest;
    }
}
#endif
