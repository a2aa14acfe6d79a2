// What every pass has: the workgroup size as specialisation constant 0, buffers by address, and the Vulkan memory model.
#ifndef HEDGEROW_GPU_PASS
#define HEDGEROW_GPU_PASS
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#pragma use_vulkan_memory_model
#include "gpu/division.glsl"

layout(local_size_x_id = 0) in;

// A dispatch of more workgroups than a device takes along x has rows of as many as it takes: src/gpu/recorder.rs.
layout(constant_id = 30) const uint GROUPS_OF_A_ROW = 65535;

// A shader that one workgroup runs defines HEDGEROW_ONE_WORKGROUP: it may be one of many that do the same with arguments of their own
// (build/by_table.rs).
#ifdef HEDGEROW_ONE_WORKGROUP
uint group_number() {
    return 0u;
}

uint group_count() {
    return 1u;
}
#else
uint group_number() {
    return gl_WorkGroupID.y * GROUPS_OF_A_ROW + gl_WorkGroupID.x;
}

// Of a dispatch of one row.
uint group_count() {
    return gl_NumWorkGroups.x;
}
#endif

uint invocation_number() {
    return group_number() * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
}

// `nonprivate`: what one workgroup writes another may read within the same dispatch, ordered by the barriers below. glslang drops the word
// here, and build/memory_model.rs puts it back.
#define BUFFER layout(buffer_reference, scalar, buffer_reference_align = 4) nonprivate buffer
BUFFER Words { uint word[]; };
BUFFER Floats { float value[]; };

// Makes what this invocation has written available to the device, before an atomic that announces it.
void release_to_device() {
    memoryBarrier(gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsRelease | gl_SemanticsMakeAvailable);
}

// Makes what others have released visible to this invocation, after the atomic that announced it.
void acquire_from_device() {
    memoryBarrier(gl_ScopeDevice, gl_StorageSemanticsBuffer, gl_SemanticsAcquire | gl_SemanticsMakeVisible);
}

// What one phase of a workgroup has written to memory, the next reads. All its invocations come here together.
void next_phase() {
    controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer | gl_StorageSemanticsShared,
                   gl_SemanticsAcquireRelease | gl_SemanticsMakeAvailable | gl_SemanticsMakeVisible);
}
#endif
