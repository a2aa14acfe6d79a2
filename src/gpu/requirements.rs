//! Everything the library requires of a device, in one place (DESIGN: rule 9).

use crate::{Error, Result};
use ash::vk;
use std::ffi::CStr;

/// The features to enable when the device is created; `push_into` chains them behind a `vk::DeviceCreateInfo`.
///
/// All are core in Vulkan 1.2. Nothing else is required: no extension, no 64-bit integers, no float atomics.
#[derive(Debug, Clone, Copy)]
pub struct Features {
    vulkan_1_2: vk::PhysicalDeviceVulkan12Features<'static>,
}

impl Features {
    fn required() -> Features {
        let vulkan_1_2 = vk::PhysicalDeviceVulkan12Features::default()
            .buffer_device_address(true)
            .vulkan_memory_model(true)
            .vulkan_memory_model_device_scope(true)
            .scalar_block_layout(true);
        Features { vulkan_1_2 }
    }

    /// Chains the features behind `info`. If the chain already holds a `VkPhysicalDeviceVulkan12Features`, set the four
    /// members there instead: `bufferDeviceAddress`, `vulkanMemoryModel`, `vulkanMemoryModelDeviceScope`,
    /// `scalarBlockLayout`.
    pub fn push_into<'a>(&'a mut self, info: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        info.push_next(&mut self.vulkan_1_2)
    }
}

/// What [`requirements`] found of a device that can be used.
#[derive(Debug, Clone)]
pub struct Requirements {
    /// The Vulkan version to ask for in `VkApplicationInfo` and to have on the device, at least.
    pub api_version: u32,
    /// Device extensions to enable (none today).
    pub extensions: &'static [&'static CStr],
    /// Features to enable.
    pub features: Features,
    /// What a queue family must have.
    pub queue_flags: vk::QueueFlags,
    /// The first queue family that has it, of those without graphics where there is one with timestamps.
    pub queue_family: u32,
}

/// Bytes of push constants that the passes use at most; Vulkan guarantees 128.
pub const PUSH_CONSTANT_BYTES: u32 = 128;

/// The subgroup operations that the passes use, in compute shaders.
const SUBGROUP_OPERATIONS: [(vk::SubgroupFeatureFlags, &str); 5] = [
    (vk::SubgroupFeatureFlags::BASIC, "basic"),
    (vk::SubgroupFeatureFlags::VOTE, "vote"),
    (vk::SubgroupFeatureFlags::BALLOT, "ballot"),
    (vk::SubgroupFeatureFlags::ARITHMETIC, "arithmetic"),
    (vk::SubgroupFeatureFlags::SHUFFLE, "shuffle"),
];

/// What the library needs of `physical_device`: ask before creating the device, and enable what is returned.
///
/// # Errors
/// [`Error::Unsupported`] lists everything that the device lacks.
pub fn requirements(instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> Result<Requirements> {
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup);
    // SAFETY: the handles are the caller's and live; the structures are chained and outlive the calls.
    let families = unsafe {
        instance.get_physical_device_properties2(physical_device, &mut properties);
        instance.get_physical_device_queue_family_properties(physical_device)
    };
    let properties = properties.properties;
    let name = properties.device_name_as_c_str().unwrap_or(c"?").to_string_lossy().into_owned();

    let mut missing = Vec::new();
    if properties.api_version < vk::API_VERSION_1_2 {
        let (major, minor) =
            (vk::api_version_major(properties.api_version), vk::api_version_minor(properties.api_version));
        return Err(Error::Unsupported { device: name, missing: vec![format!("Vulkan 1.2 (it has {major}.{minor})")] });
    }
    let mut has = vk::PhysicalDeviceVulkan12Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut has);
    // SAFETY: as above.
    unsafe { instance.get_physical_device_features2(physical_device, &mut features) };
    for (there, feature) in [
        (has.buffer_device_address, "bufferDeviceAddress"),
        (has.vulkan_memory_model, "vulkanMemoryModel"),
        (has.vulkan_memory_model_device_scope, "vulkanMemoryModelDeviceScope"),
        (has.scalar_block_layout, "scalarBlockLayout"),
    ] {
        if there == vk::FALSE {
            missing.push(format!("the feature {feature}"));
        }
    }
    for (operations, called) in SUBGROUP_OPERATIONS {
        if !subgroup.supported_operations.contains(operations) {
            missing.push(format!("{called} subgroup operations"));
        }
    }
    if !subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE) {
        missing.push("subgroup operations in compute shaders".into());
    }
    if !(4..=128).contains(&subgroup.subgroup_size) {
        missing.push(format!("subgroups of 4 to 128 (it has {})", subgroup.subgroup_size));
    }

    let candidates = || families.iter().enumerate().filter(|(_, f)| f.queue_flags.contains(vk::QueueFlags::COMPUTE));
    let dedicated = candidates()
        .find(|(_, f)| !f.queue_flags.contains(vk::QueueFlags::GRAPHICS) && f.timestamp_valid_bits > 0)
        .or_else(|| candidates().next());
    if dedicated.is_none() {
        missing.push("a compute queue".into());
    }
    match dedicated {
        Some((family, _)) if missing.is_empty() => Ok(Requirements {
            api_version: vk::API_VERSION_1_2,
            extensions: &[],
            features: Features::required(),
            queue_flags: vk::QueueFlags::COMPUTE,
            queue_family: family as u32,
        }),
        _ => Err(Error::Unsupported { device: name, missing }),
    }
}
