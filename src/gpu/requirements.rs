//! Everything the library requires of a device, in one place (DESIGN: rule 9).

use super::Features;
use crate::{Error, Result};
use ash::vk;
use std::ffi::CStr;

/// Features that change the speed and never the results. They count if the device has them and they are enabled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Optional {
    /// `VK_EXT_subgroup_size_control` with its features `subgroupSizeControl` and `computeFullSubgroups`: pipelines ask for full
    /// subgroups of a known size. Without it kernels expect any size up to the reported one.
    pub subgroup_size_control: bool,
    /// `VK_KHR_shader_maximal_reconvergence` with its feature `shaderMaximalReconvergence`: lanes meet again where the source
    /// says. No kernel relies on it, so it is enabled only where [`Requirements::only`] asks for it.
    pub maximal_reconvergence: bool,
    /// The feature `shaderInt64`: on CPUs, tracers and queries load elements of 64 bits, 1.02 to 1.2 times as fast, and builds take 0.7 to 0.9 of
    /// the time on some ([`super::BuildTuning::in_longs`]). It lies in
    /// `VkPhysicalDeviceFeatures`, which an engine fills in itself, so that it is enabled only where [`Requirements::only`] asks for it;
    /// whoever enables it there says so in [`super::ContextDesc::optional`].
    pub int64: bool,
}

impl Optional {
    /// Nothing is enabled that [`requirements`] did not require: always right.
    pub const NONE: Optional = Optional { subgroup_size_control: false, maximal_reconvergence: false, int64: false };

    /// What [`requirements`] enables if the device has it: the features that kernels use and that lie in structures of their own.
    pub const DEFAULT: Optional = Optional { subgroup_size_control: true, ..Optional::NONE };

    /// What both have.
    pub fn and(self, other: Optional) -> Optional {
        Optional {
            subgroup_size_control: self.subgroup_size_control && other.subgroup_size_control,
            maximal_reconvergence: self.maximal_reconvergence && other.maximal_reconvergence,
            int64: self.int64 && other.int64,
        }
    }

    /// The names of what is there, as `hedgerow devices` prints them.
    pub fn names(self) -> Vec<&'static str> {
        let subgroups = self.subgroup_size_control.then_some("subgroup size control");
        let reconvergence = self.maximal_reconvergence.then_some("maximal reconvergence");
        let int64 = self.int64.then_some("64-bit integers");
        subgroups.into_iter().chain(reconvergence).chain(int64).collect()
    }

    fn extensions(self) -> Vec<&'static CStr> {
        let subgroups = self.subgroup_size_control.then_some(ash::ext::subgroup_size_control::NAME);
        let reconvergence = self.maximal_reconvergence.then_some(ash::khr::shader_maximal_reconvergence::NAME);
        subgroups.into_iter().chain(reconvergence).collect()
    }

    /// What a device has of it. Extensions are asked for even where a version of Vulkan has taken them up: the version that the
    /// instance was made for is not known here.
    fn of(instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> Optional {
        let offered = Offered::by(instance, physical_device);
        let mut subgroups = vk::PhysicalDeviceSubgroupSizeControlFeatures::default();
        let mut reconvergence = vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR::default();
        let mut features = vk::PhysicalDeviceFeatures2::default();
        let offers_subgroups = offered.has(ash::ext::subgroup_size_control::NAME);
        let offers_reconvergence = offered.has(ash::khr::shader_maximal_reconvergence::NAME);
        if offers_subgroups {
            features = features.push_next(&mut subgroups);
        }
        if offers_reconvergence {
            features = features.push_next(&mut reconvergence);
        }
        // SAFETY: the handles are the caller's and live; the structures are chained and outlive the call.
        unsafe { instance.get_physical_device_features2(physical_device, &mut features) };
        let int64 = features.features.shader_int64 != vk::FALSE;
        let full = subgroups.subgroup_size_control & subgroups.compute_full_subgroups != vk::FALSE;
        Optional {
            subgroup_size_control: offers_subgroups
                && full
                && SubgroupSizes::of(instance, physical_device).can_be_required,
            maximal_reconvergence: offers_reconvergence && reconvergence.shader_maximal_reconvergence != vk::FALSE,
            int64,
        }
    }
}

/// Extensions that a device offers.
#[doc(hidden)]
pub struct Offered(Vec<vk::ExtensionProperties>);

impl Offered {
    #[doc(hidden)]
    pub fn by(instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> Offered {
        // SAFETY: the handles are the caller's and live. A device that cannot list them is taken to offer none.
        Offered(unsafe { instance.enumerate_device_extension_properties(physical_device) }.unwrap_or_default())
    }

    #[doc(hidden)]
    pub fn has(&self, name: &CStr) -> bool {
        self.0.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name))
    }
}

/// The sizes that subgroups of compute shaders may have.
#[derive(Debug, Clone, Copy)]
pub(super) struct SubgroupSizes {
    pub least: u32,
    pub most: u32,
    /// Subgroups of a workgroup, at most, where the size is required.
    pub of_a_workgroup: u32,
    /// Whether a compute pipeline can ask for a size between them.
    pub can_be_required: bool,
}

impl SubgroupSizes {
    /// Of a device that does not offer `VK_EXT_subgroup_size_control`: any up to the reported size.
    const UNKNOWN: SubgroupSizes =
        SubgroupSizes { least: 1, most: u32::MAX, of_a_workgroup: 0, can_be_required: false };

    pub(super) fn of(instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> SubgroupSizes {
        if !Offered::by(instance, physical_device).has(ash::ext::subgroup_size_control::NAME) {
            return SubgroupSizes::UNKNOWN;
        }
        let mut sizes = vk::PhysicalDeviceSubgroupSizeControlProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut sizes);
        // SAFETY: as in `Optional::of`.
        unsafe { instance.get_physical_device_properties2(physical_device, &mut properties) };
        SubgroupSizes {
            least: sizes.min_subgroup_size,
            most: sizes.max_subgroup_size,
            of_a_workgroup: sizes.max_compute_workgroup_subgroups,
            can_be_required: sizes.required_subgroup_size_stages.contains(vk::ShaderStageFlags::COMPUTE),
        }
    }
}

/// What to enable on a device that can be used: the answer of [`requirements`].
#[derive(Debug, Clone)]
pub struct Requirements {
    /// The Vulkan version to ask for in `VkApplicationInfo` and to have on the device, at least.
    pub api_version: u32,
    /// Device extensions to enable: those of `optional`, as nothing else is an extension.
    pub extensions: Vec<&'static CStr>,
    /// Features to enable.
    pub features: Features,
    /// The optional part of the extensions and features: pass it on as [`super::ContextDesc::optional`].
    pub optional: Optional,
    /// The optional features that the device has.
    pub available: Optional,
    /// What a queue family must have.
    pub queue_flags: vk::QueueFlags,
    /// The queue family to take: it has compute and timestamps, and if possible no graphics.
    pub queue_family: u32,
}

impl Requirements {
    /// The same with only the `wanted` optional features, as far as the device has them.
    pub fn only(mut self, wanted: Optional) -> Requirements {
        self.optional = self.available.and(wanted);
        self.extensions = self.optional.extensions();
        self.features = Features::with(self.optional);
        self
    }
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

    let family = queue_family(&families);
    if family.is_none() {
        missing.push("a compute queue".into());
    }
    match family {
        Some(queue_family) if missing.is_empty() => {
            let available = Optional::of(instance, physical_device);
            let optional = available.and(Optional::DEFAULT);
            Ok(Requirements {
                api_version: vk::API_VERSION_1_2,
                extensions: optional.extensions(),
                features: Features::with(optional),
                optional,
                available,
                queue_flags: vk::QueueFlags::COMPUTE,
                queue_family,
            })
        }
        _ => Err(Error::Unsupported { device: name, missing }),
    }
}

/// The compute family to take: one with timestamps rather than without, then one without graphics rather than with, then the first.
pub(super) fn queue_family(families: &[vk::QueueFamilyProperties]) -> Option<u32> {
    let rank = |family: &vk::QueueFamilyProperties| {
        (family.timestamp_valid_bits == 0, family.queue_flags.contains(vk::QueueFlags::GRAPHICS))
    };
    let computes = |family: &&vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
    let best = families.iter().filter(computes).map(rank).min()?;
    families.iter().position(|family| computes(&family) && rank(family) == best).map(|family| family as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_queue_family_is_chosen_by_compute_then_timestamps_then_no_graphics() {
        let family = |flags, bits| {
            vk::QueueFamilyProperties::default().queue_flags(flags).queue_count(1).timestamp_valid_bits(bits)
        };
        let (compute, transfer) = (vk::QueueFlags::COMPUTE, vk::QueueFlags::TRANSFER);
        let graphics = compute | vk::QueueFlags::GRAPHICS;
        assert_eq!(queue_family(&[]), None);
        assert_eq!(queue_family(&[family(transfer, 64)]), None);
        assert_eq!(queue_family(&[family(transfer, 64), family(graphics, 64)]), Some(1));
        assert_eq!(queue_family(&[family(graphics, 64), family(transfer, 64), family(compute, 64)]), Some(2));
        assert_eq!(queue_family(&[family(compute, 0), family(graphics, 36)]), Some(1), "timestamps come first");
        assert_eq!(queue_family(&[family(graphics, 0), family(compute, 0)]), Some(1));
        assert_eq!(queue_family(&[family(compute, 36), family(compute, 64)]), Some(0), "the first of equals");
    }
}
