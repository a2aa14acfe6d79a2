#version 460
// An object that has a tree, for merge_push.comp to begin with; one invocation. See kdtree/merge.glsl.
#include "kdtree/merge/state.glsl"

layout(push_constant, scalar) uniform MergeSeedArguments {
    uvec2 seed_address;
    uvec2 tree;
    uint first_tile;
};

void main() {
    if (gl_LocalInvocationIndex == 0u) KdSeeds(seed_address).seed[0] = KdSeed(tree, first_tile);
}
