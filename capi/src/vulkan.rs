//! Vulkan's types under their names in C: so the signatures here are those of the header, and the header needs no table of
//! names.

pub use hedgerow::ash::vk::{
    AccelerationStructureBuildGeometryInfoKHR as VkAccelerationStructureBuildGeometryInfoKHR,
    AccelerationStructureBuildRangeInfoKHR as VkAccelerationStructureBuildRangeInfoKHR,
    AccelerationStructureBuildSizesInfoKHR as VkAccelerationStructureBuildSizesInfoKHR,
    AccelerationStructureBuildTypeKHR as VkAccelerationStructureBuildTypeKHR,
    AccelerationStructureCompatibilityKHR as VkAccelerationStructureCompatibilityKHR,
    AccelerationStructureCreateInfoKHR as VkAccelerationStructureCreateInfoKHR,
    AccelerationStructureDeviceAddressInfoKHR as VkAccelerationStructureDeviceAddressInfoKHR,
    AccelerationStructureKHR as VkAccelerationStructureKHR,
    AccelerationStructureVersionInfoKHR as VkAccelerationStructureVersionInfoKHR,
    AllocationCallbacks as VkAllocationCallbacks, Bool32 as VkBool32, Buffer as VkBuffer,
    CommandBuffer as VkCommandBuffer, CopyAccelerationStructureInfoKHR as VkCopyAccelerationStructureInfoKHR,
    CopyAccelerationStructureToMemoryInfoKHR as VkCopyAccelerationStructureToMemoryInfoKHR,
    CopyMemoryToAccelerationStructureInfoKHR as VkCopyMemoryToAccelerationStructureInfoKHR, Device as VkDevice,
    DeviceAddress as VkDeviceAddress, DeviceSize as VkDeviceSize, Instance as VkInstance,
    PhysicalDevice as VkPhysicalDevice, PipelineCache as VkPipelineCache, QueueFlags as VkQueueFlags,
    Result as VkResult,
};

/// Null in C where it is `None` here.
#[allow(non_camel_case_types, reason = "the name that it has in C")]
pub type PFN_vkGetInstanceProcAddr = Option<hedgerow::ash::vk::PFN_vkGetInstanceProcAddr>;
