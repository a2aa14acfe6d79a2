//! The functions of `VK_KHR_acceleration_structure`, with a context in place of the device: [`hedgerow::accel`].

use crate::context::{HedgerowContext, structures_of};
use crate::pointers::{handle, place, reference, reference_mut, slice, slices};
use crate::status::{status, value_or};
use crate::vulkan::*;
use hedgerow::accel;
use hedgerow::gpu::ArgumentMemory;

/// What scratch addresses must be multiples of.
pub const HEDGEROW_SCRATCH_ALIGNMENT: u32 = 16;
/// What the offset of a structure in its buffer must be a multiple of.
pub const HEDGEROW_STRUCTURE_ALIGNMENT: u32 = 256;
const _: () = assert!(
    HEDGEROW_SCRATCH_ALIGNMENT as u64 == accel::SCRATCH_ALIGNMENT
        && HEDGEROW_STRUCTURE_ALIGNMENT as u64 == accel::STRUCTURE_ALIGNMENT
);

/// A build flag of hedgerow's own: a top level may open instances whose boxes are loose (re-braiding).
pub const HEDGEROW_BUILD_ACCELERATION_STRUCTURE_REBRAID_BIT: u32 = 1 << 30;
const _: () = assert!(HEDGEROW_BUILD_ACCELERATION_STRUCTURE_REBRAID_BIT == accel::REBRAID.as_raw());
/// Another: children get an order for rays that end at their first hit, which queries with TerminateOnFirstHit follow.
pub const HEDGEROW_BUILD_ACCELERATION_STRUCTURE_ANY_HIT_ORDER_BIT: u32 = 1 << 29;
const _: () = assert!(HEDGEROW_BUILD_ACCELERATION_STRUCTURE_ANY_HIT_ORDER_BIT == accel::ANY_HIT_ORDER.as_raw());

/// `vkGetAccelerationStructureBuildSizesKHR`: bytes that a build of at most this many primitives a geometry needs.
///
/// # Safety
/// As Vulkan's. Addresses in the geometries are not looked at.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_get_acceleration_structure_build_sizes(
    context: *const HedgerowContext,
    build_type: VkAccelerationStructureBuildTypeKHR,
    p_build_info: *const VkAccelerationStructureBuildGeometryInfoKHR<'_>,
    p_max_primitive_counts: *const u32,
    p_size_info: *mut VkAccelerationStructureBuildSizesInfoKHR<'_>,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let info = reference(p_build_info, "pBuildInfo")?;
        let counts = slice(p_max_primitive_counts, info.geometry_count, "pMaxPrimitiveCounts")?;
        let sizes = reference_mut(p_size_info, "pSizeInfo")?;
        structures_of(context)?.get_acceleration_structure_build_sizes(build_type, info, counts, sizes)
    })
}

/// `vkCreateAccelerationStructureKHR`: a handle for a place in a buffer. Nothing is allocated.
///
/// # Safety
/// As Vulkan's. The buffer has the usages `VK_BUFFER_USAGE_STORAGE_BUFFER_BIT` and
/// `VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_create_acceleration_structure(
    context: *const HedgerowContext,
    p_create_info: *const VkAccelerationStructureCreateInfoKHR<'_>,
    p_allocator: *const VkAllocationCallbacks<'_>,
    p_acceleration_structure: *mut VkAccelerationStructureKHR,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let info = reference(p_create_info, "pCreateInfo")?;
        handle(info.buffer, "pCreateInfo->buffer")?;
        let place = place(p_acceleration_structure, "pAccelerationStructure")?;
        place.write(structures_of(context)?.create_acceleration_structure(info, p_allocator.as_ref())?);
        Ok(())
    })
}

/// `vkDestroyAccelerationStructureKHR`. A handle owns nothing: the memory is the caller's before and after.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_destroy_acceleration_structure(
    context: *const HedgerowContext,
    acceleration_structure: VkAccelerationStructureKHR,
    p_allocator: *const VkAllocationCallbacks<'_>,
) {
    value_or((), || {
        // SAFETY: the caller's promises.
        unsafe { structures_of(context)?.destroy_acceleration_structure(acceleration_structure, p_allocator.as_ref()) };
        Ok(())
    });
}

/// `vkGetAccelerationStructureDeviceAddressKHR`: what shaders and hedgerow_cmd_trace_rays trace through; 0 after an error.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_get_acceleration_structure_device_address(
    context: *const HedgerowContext,
    p_info: *const VkAccelerationStructureDeviceAddressInfoKHR<'_>,
) -> VkDeviceAddress {
    value_or(0, || {
        // SAFETY: the caller's promises.
        let (structures, info) = unsafe { (structures_of(context)?, reference(p_info, "pInfo")?) };
        Ok(structures.get_acceleration_structure_device_address(info))
    })
}

/// `vkCmdBuildAccelerationStructuresKHR`: records builds, side by side. After an error nothing is recorded.
///
/// Builds read and write in compute shaders: where the driver's want the stage
/// `VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR` in a barrier, these want `VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT`
/// with `VK_ACCESS_SHADER_READ_BIT` and `VK_ACCESS_SHADER_WRITE_BIT`. The bound compute pipeline and the push constants
/// are others afterwards.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_build_acceleration_structures(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    info_count: u32,
    p_infos: *const VkAccelerationStructureBuildGeometryInfoKHR<'_>,
    pp_build_range_infos: *const *const VkAccelerationStructureBuildRangeInfoKHR,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let infos = slice(p_infos, info_count, "pInfos")?;
        let ranges = slices(pp_build_range_infos, infos, "ppBuildRangeInfos")?;
        let commands = handle(command_buffer, "commandBuffer")?;
        structures_of(context)?.cmd_build_acceleration_structures(commands, infos, &ranges)
    })
}

/// Memory for the arguments of builds: a part of a buffer with the usage `VK_BUFFER_USAGE_TRANSFER_DST_BIT`,
/// `VK_BUFFER_USAGE_STORAGE_BUFFER_BIT` and `VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT`. It is a call's own while it runs, as scratch
/// memory is.
#[repr(C)]
pub struct HedgerowArgumentMemory {
    /// The buffer.
    pub buffer: VkBuffer,
    /// Where in the buffer it begins; the address there is a multiple of 16.
    pub offset: VkDeviceSize,
    /// Its length in bytes.
    pub size: VkDeviceSize,
}

/// Bytes that suffice for the arguments of one call of so many builds with so many geometries in all.
#[unsafe(no_mangle)]
pub extern "C" fn hedgerow_get_argument_size(info_count: u32, geometry_count: u32) -> VkDeviceSize {
    accel::Device::argument_bytes(info_count.into(), geometry_count.into())
}

/// hedgerow_cmd_build_acceleration_structures with the arguments in memory: thousands of small builds are one dispatch for all of a
/// kind in place of one for two.
///
/// # Safety
/// As Vulkan's; the memory is as HedgerowArgumentMemory says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_build_acceleration_structures_by_table(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    info_count: u32,
    p_infos: *const VkAccelerationStructureBuildGeometryInfoKHR<'_>,
    pp_build_range_infos: *const *const VkAccelerationStructureBuildRangeInfoKHR,
    p_argument_memory: *const HedgerowArgumentMemory,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let infos = slice(p_infos, info_count, "pInfos")?;
        let ranges = slices(pp_build_range_infos, infos, "ppBuildRangeInfos")?;
        let commands = handle(command_buffer, "commandBuffer")?;
        let memory = reference(p_argument_memory, "pArgumentMemory")?;
        let memory = ArgumentMemory {
            buffer: handle(memory.buffer, "pArgumentMemory->buffer")?,
            offset: memory.offset,
            bytes: memory.size,
        };
        structures_of(context)?.with_arguments_in(memory).cmd_build_acceleration_structures(commands, infos, &ranges)
    })
}

/// `vkCmdBuildAccelerationStructuresIndirectKHR`: like hedgerow_cmd_build_acceleration_structures, with the ranges in device
/// memory.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_build_acceleration_structures_indirect(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    info_count: u32,
    p_infos: *const VkAccelerationStructureBuildGeometryInfoKHR<'_>,
    p_indirect_device_addresses: *const VkDeviceAddress,
    p_indirect_strides: *const u32,
    pp_max_primitive_counts: *const *const u32,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let infos = slice(p_infos, info_count, "pInfos")?;
        let addresses = slice(p_indirect_device_addresses, info_count, "pIndirectDeviceAddresses")?;
        let strides = slice(p_indirect_strides, info_count, "pIndirectStrides")?;
        let counts = slices(pp_max_primitive_counts, infos, "ppMaxPrimitiveCounts")?;
        let commands = handle(command_buffer, "commandBuffer")?;
        structures_of(context)?.cmd_build_acceleration_structures_indirect(commands, infos, addresses, strides, &counts)
    })
}
