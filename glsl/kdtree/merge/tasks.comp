#version 460
// A task of the first level for each marked leaf; workgroups share the tiles. See kdtree/merge.glsl.
#include "kdtree/merge/mark.glsl"

void main() {
    uint tiles = tiles_of(merge_state().marked_count);
    for (uint tile = group_number(); tile < tiles; tile += gl_NumWorkGroups.x) write_marked_tile(tile);
}
