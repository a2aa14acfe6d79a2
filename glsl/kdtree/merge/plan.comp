#version 460
// Where the records of each tile of all objects go; one workgroup. See kdtree/merge.glsl.
#include "kdtree/merge.glsl"

void main() {
    KdState state = build_state();
    KdMerge merge = merge_state();
    uint found = scan_chunks(merge.tiles).x;
    if (gl_LocalInvocationIndex != 0u) return;
    bool fits = state.first_record <= record_room && found <= record_room - state.first_record;
    if (!fits) merge.status = STATUS_OUT_OF_ROOM;
    state.active_count = fits ? found : 0u;
    PoolState pool = PoolState(state_address);
    pool_reset(pool, PUSH_PHASES);
    if (state.active_count > 0u) pool.tasks[0] = (merge.seed_count + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
}
