#version 460
// A level of the top: see bvh/hlbvh.glsl for the contract. Workgroups share the tasks that there are.
#include "bvh/hlbvh/split.glsl"

void main() {
    uint tasks = task_count(level);
    for (uint i = group_number(); i < tasks; i += gl_NumWorkGroups.x) hlbvh_split(i, level, false);
}
