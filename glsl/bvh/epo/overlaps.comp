#version 460
// For each record, the area of its triangle in nodes that it is not of: see bvh/epo.glsl for the contract.
//
// On the way from the triangle's leaf to the root, the other child of each node is a subtree that the triangle is not of: where
// the triangle reaches into its box, the children of it follow. An invocation that is done with a record takes its next one
// without waiting for its neighbours.
#include "bvh/epo.glsl"
#include "bvh/surface.glsl"

const uint STACK = MAX_DEPTH + 2;

Child child_of(uint name) {
    uint slot = name >> 1;
    if ((name & 1) == 0) return structure.nodes[slot].left;
    return structure.nodes[slot].right;
}

void main() {
    Child root = structure.header.root;
    uint slots = structure.header.node_slots;
    bool usable = structure.header.active_count != 0 && (structure.header.status & STATUS_UNUSABLE) == 0;
    // Brings the longest edge of the scene near 1: src/bvh/sah.rs, area_scale.
    vec3 half_extent = 0.5 * root.hi - 0.5 * root.lo;
    float longest = max(half_extent.x, max(half_extent.y, half_extent.z));
    int exponent = int(floatBitsToUint(longest) >> 23 & 0xFFu);
    float scale = uintBitsToFloat(uint(clamp(127 + 127 - exponent, 1, 254)) << 23);
    Triangles triangles = triangles_of(structure);

    uint tile = gl_WorkGroupSize.x * rounds;
    uint next = group_number() * tile + gl_LocalInvocationIndex;
    uint end = min(count, (group_number() + 1) * tile);
    uint stack[STACK];
    uint waiting = 0;         // entries of the stack
    uint path = NONE;         // what names the node or leaf that the climb has come to
    uint record = NONE;
    uint visits = 0;          // that are left for the record: a tree has no more children, a circle has no end
    Surface surface;
    vec3 found;
    vec3 lo, hi;
    while (true) {
        while (waiting == 0) {
            if (path == NONE) {
                if (record != NONE) sums.of[record] = found;
                if (next >= end) break;
                record = first + next;
                next += gl_WorkGroupSize.x;
                visits = 2 * slots + MAX_DEPTH;
                path = usable ? parents.word[slots + record] : NONE;
                found = vec3(0.0);
                // The records of a root that is a leaf have no parent, and are of every node.
                if (path != NONE || usable && record - root.index < root.count) {
                    Triangle t = triangles.triangle[record];
                    surface = surface_of(t.v0 * scale, t.v1 * scale, t.v2 * scale);
                    found.z = surface.area;
                    if (surface.area == 0.0) path = NONE;
                }
            } else {
                uint slot = path >> 1;
                uint other = path ^ 1;
                visits -= 1;
                path = slot == root.index || visits == 0 ? NONE : parents.word[slot];
                Child child = child_of(other);
                if (common_box(surface, child.lo * scale, child.hi * scale, lo, hi)) {
                    stack[0] = other;
                    waiting = 1;
                }
            }
        }
        if (waiting == 0) break;
        waiting -= 1;
        Child child = child_of(stack[waiting]);
        common_box(surface, child.lo * scale, child.hi * scale, lo, hi);
        float area = area_inside(surface, lo, hi);
        visits = max(visits, 2) - 1;
        if (child.count != 0) {
            found.y += area * float(child.count);
        } else if (area > 0.0 && visits > 1) {
            found.x += area;
            Node node = structure.nodes[child.index];
            if (common_box(surface, node.right.lo * scale, node.right.hi * scale, lo, hi) && waiting < STACK) {
                stack[waiting] = 2 * child.index + 1;
                waiting += 1;
            }
            if (common_box(surface, node.left.lo * scale, node.left.hi * scale, lo, hi) && waiting < STACK) {
                stack[waiting] = 2 * child.index;
                waiting += 1;
            }
        }
    }
}
