#version 460
// What the tasks of a level make, and what the next level has; workgroups share the tiles of tasks. See kdtree/builder.glsl.
#include "kdtree/scan.glsl"

void main() {
    uint tiles = tiles_of(build_state().task_count[level]);
    for (uint i = group_number(); i < tiles; i += gl_NumWorkGroups.x) kd_scan_tile(i, level);
}
