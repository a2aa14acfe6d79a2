//! Copies of structures and their properties: [`hedgerow::accel`].

use crate::context::{HedgerowContext, structures_of};
use crate::pointers::{handle, reference, slice};
use crate::status::{status, value_or};
use crate::vulkan::*;
use hedgerow::Error;
use hedgerow::accel::Property;

/// Bytes of a compacted copy.
pub const HEDGEROW_PROPERTY_COMPACTED_SIZE: u32 = 0;
/// Bytes in memory when serialised.
pub const HEDGEROW_PROPERTY_SERIALIZED_SIZE: u32 = 1;
/// Handles of a serialised top level.
pub const HEDGEROW_PROPERTY_BOTTOM_LEVEL_POINTERS: u32 = 2;
/// Bytes that are in use: those of a clone.
pub const HEDGEROW_PROPERTY_SIZE: u32 = 3;
/// Nodes of the tree.
pub const HEDGEROW_PROPERTY_NODE_COUNT: u32 = 4;
/// The bits of a float: the SAH cost.
pub const HEDGEROW_PROPERTY_SAH: u32 = 5;
/// The bits of a float: how many times the SAH cost is what it was at the last build.
pub const HEDGEROW_PROPERTY_SAH_GROWTH: u32 = 6;
/// Zero is a structure without a blemish.
pub const HEDGEROW_PROPERTY_STATUS: u32 = 7;

/// By their numbers.
const PROPERTIES: [Property; 8] = [
    Property::CompactedSize,
    Property::SerializedSize,
    Property::BottomLevelPointers,
    Property::Size,
    Property::NodeCount,
    Property::Sah,
    Property::SahGrowth,
    Property::Status,
];

/// `vkCmdCopyAccelerationStructureKHR`: clones or compacts.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_copy_acceleration_structure(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    p_info: *const VkCopyAccelerationStructureInfoKHR<'_>,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let (commands, info) = (handle(command_buffer, "commandBuffer")?, reference(p_info, "pInfo")?);
        structures_of(context)?.cmd_copy_acceleration_structure(commands, info)
    })
}

/// `vkCmdCopyAccelerationStructureToMemoryKHR`: serialises.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_copy_acceleration_structure_to_memory(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    p_info: *const VkCopyAccelerationStructureToMemoryInfoKHR<'_>,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let (commands, info) = (handle(command_buffer, "commandBuffer")?, reference(p_info, "pInfo")?);
        structures_of(context)?.cmd_copy_acceleration_structure_to_memory(commands, info)
    })
}

/// `vkCmdCopyMemoryToAccelerationStructureKHR`: deserialises.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_copy_memory_to_acceleration_structure(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    p_info: *const VkCopyMemoryToAccelerationStructureInfoKHR<'_>,
) -> VkResult {
    // SAFETY: the caller's promises.
    status(|| unsafe {
        let (commands, info) = (handle(command_buffer, "commandBuffer")?, reference(p_info, "pInfo")?);
        structures_of(context)?.cmd_copy_memory_to_acceleration_structure(commands, info)
    })
}

/// `vkGetDeviceAccelerationStructureCompatibilityKHR`: incompatible after an error.
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_get_device_acceleration_structure_compatibility(
    context: *const HedgerowContext,
    p_version_info: *const VkAccelerationStructureVersionInfoKHR<'_>,
) -> VkAccelerationStructureCompatibilityKHR {
    value_or(VkAccelerationStructureCompatibilityKHR::INCOMPATIBLE, || {
        // SAFETY: the caller's promises.
        let (structures, info) = unsafe { (structures_of(context)?, reference(p_version_info, "pVersionInfo")?) };
        Ok(structures.get_device_acceleration_structure_compatibility(info))
    })
}

/// `vkCmdWriteAccelerationStructuresPropertiesKHR`, but for where the results go: a 64-bit number each, from a device address
/// on that is a multiple of 8. `property` is one of HEDGEROW_PROPERTY_….
///
/// # Safety
/// As Vulkan's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_write_acceleration_structures_properties(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    acceleration_structure_count: u32,
    p_acceleration_structures: *const VkAccelerationStructureKHR,
    property: u32,
    results: VkDeviceAddress,
) -> VkResult {
    status(|| {
        let Some(&property) = PROPERTIES.get(property as usize) else {
            return Err(Error::Argument(format!("property is {property}; take one of HEDGEROW_PROPERTY_…")));
        };
        // SAFETY: the caller's promises.
        unsafe {
            let all = slice(p_acceleration_structures, acceleration_structure_count, "pAccelerationStructures")?;
            let commands = handle(command_buffer, "commandBuffer")?;
            structures_of(context)?.cmd_write_acceleration_structures_properties(commands, all, property, results)
        }
    })
}
