#version 460
// Refits of small structures, each by one workgroup that does both phases: two refits a dispatch. See bvh/refit.glsl for the
// phases' contracts.
//
// needs  nothing of other workgroups; subgroups of any size; workgroups of whole subgroups
#include "bvh/refit.glsl"

void main() {
    Update update = updates[group_number()];
    uint tile = gl_WorkGroupSize.x * RUN;
    uint tiles = (update.primitive_count + tile - 1u) / tile;
    for (uint task = 0; task < tiles; ++task) refit_leaves(update, task);
    controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer,
                   gl_SemanticsAcquireRelease | gl_SemanticsMakeAvailable | gl_SemanticsMakeVisible);
    for (uint task = 0; task < tiles; ++task) refit_climb(update, task);
}
