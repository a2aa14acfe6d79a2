//! The features that a device is created with, chained behind the structures of whoever creates it.

use super::Optional;
use ash::vk;

/// The features to enable when the device is created. [`Features::push_into`] chains them behind a `vk::DeviceCreateInfo` of your
/// own, [`Features::merge_into`] behind one whose chain somebody else has begun.
///
/// The required ones are core in Vulkan 1.2: no extension, no 64-bit integers, no float atomics.
#[derive(Debug, Clone, Copy)]
pub struct Features {
    vulkan_1_0: vk::PhysicalDeviceFeatures2<'static>,
    vulkan_1_2: vk::PhysicalDeviceVulkan12Features<'static>,
    // What `merge_into` chains in place of `vulkan_1_2`, which does not go with any of them.
    addresses: vk::PhysicalDeviceBufferDeviceAddressFeatures<'static>,
    memory_model: vk::PhysicalDeviceVulkanMemoryModelFeatures<'static>,
    layout: vk::PhysicalDeviceScalarBlockLayoutFeatures<'static>,
    subgroups: vk::PhysicalDeviceSubgroupSizeControlFeatures<'static>,
    reconvergence: vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR<'static>,
}

impl Features {
    pub(super) fn with(optional: Optional) -> Features {
        let int64 = vk::PhysicalDeviceFeatures::default().shader_int64(optional.int64);
        Features {
            vulkan_1_0: vk::PhysicalDeviceFeatures2::default().features(int64),
            vulkan_1_2: vk::PhysicalDeviceVulkan12Features::default()
                .buffer_device_address(true)
                .vulkan_memory_model(true)
                .vulkan_memory_model_device_scope(true)
                .scalar_block_layout(true),
            addresses: vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true),
            memory_model: vk::PhysicalDeviceVulkanMemoryModelFeatures::default()
                .vulkan_memory_model(true)
                .vulkan_memory_model_device_scope(true),
            layout: vk::PhysicalDeviceScalarBlockLayoutFeatures::default().scalar_block_layout(true),
            subgroups: vk::PhysicalDeviceSubgroupSizeControlFeatures::default()
                .subgroup_size_control(optional.subgroup_size_control)
                .compute_full_subgroups(optional.subgroup_size_control),
            reconvergence: vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR::default()
                .shader_maximal_reconvergence(optional.maximal_reconvergence),
        }
    }

    fn wants_subgroups(&self) -> bool {
        self.subgroups.subgroup_size_control != vk::FALSE
    }

    fn wants_int64(&self) -> bool {
        self.vulkan_1_0.features.shader_int64 != vk::FALSE
    }

    fn wants_reconvergence(&self) -> bool {
        self.reconvergence.shader_maximal_reconvergence != vk::FALSE
    }

    /// Chains the features behind `info`. Vulkan allows each structure once in a chain: if yours holds a
    /// `VkPhysicalDeviceVulkan12Features`, set `bufferDeviceAddress`, `vulkanMemoryModel`, `vulkanMemoryModelDeviceScope` and
    /// `scalarBlockLayout` there instead; if it holds a `VkPhysicalDeviceVulkan13Features`, `subgroupSizeControl` and
    /// `computeFullSubgroups`, or take [`super::Requirements::only`] what you want. Where [`Optional::int64`] is asked for, a
    /// `VkPhysicalDeviceFeatures2` is among them: `pEnabledFeatures` must then be null. [`Features::merge_into`] does all of this.
    pub fn push_into<'a>(&'a mut self, info: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        let (subgroups, reconvergence, int64) =
            (self.wants_subgroups(), self.wants_reconvergence(), self.wants_int64());
        let mut info = info.push_next(&mut self.vulkan_1_2);
        if subgroups {
            info = info.push_next(&mut self.subgroups);
        }
        if reconvergence {
            info = info.push_next(&mut self.reconvergence);
        }
        if int64 {
            info = info.push_next(&mut self.vulkan_1_0);
        }
        info
    }

    /// Enables the features in the structures that `info` has behind it, and chains those that it lacks: for a chain that somebody
    /// else has made, such as wgpu-hal's. What is enabled there stays enabled.
    ///
    /// # Safety
    /// Behind `info` are Vulkan's structures that may be written to, as `push_next` chains them, and nothing else reads or writes
    /// them meanwhile. Its `pEnabledFeatures` may be read; what comes back has them in the chain, if [`Optional::int64`] is asked for.
    pub unsafe fn merge_into<'a>(&'a mut self, mut info: vk::DeviceCreateInfo<'a>) -> vk::DeviceCreateInfo<'a> {
        let (subgroups, reconvergence, int64) =
            (self.wants_subgroups(), self.wants_reconvergence(), self.wants_int64());
        // SAFETY: the caller's promise, here and below; each reference ends before the next begins.
        match unsafe { chained::<vk::PhysicalDeviceVulkan12Features<'_>>(&info) } {
            Some(there) => {
                there.buffer_device_address = vk::TRUE;
                there.vulkan_memory_model = vk::TRUE;
                there.vulkan_memory_model_device_scope = vk::TRUE;
                there.scalar_block_layout = vk::TRUE;
            }
            None => {
                match unsafe { chained::<vk::PhysicalDeviceBufferDeviceAddressFeatures<'_>>(&info) } {
                    Some(there) => there.buffer_device_address = vk::TRUE,
                    None => info = info.push_next(&mut self.addresses),
                }
                match unsafe { chained::<vk::PhysicalDeviceVulkanMemoryModelFeatures<'_>>(&info) } {
                    Some(there) => {
                        there.vulkan_memory_model = vk::TRUE;
                        there.vulkan_memory_model_device_scope = vk::TRUE;
                    }
                    None => info = info.push_next(&mut self.memory_model),
                }
                match unsafe { chained::<vk::PhysicalDeviceScalarBlockLayoutFeatures<'_>>(&info) } {
                    Some(there) => there.scalar_block_layout = vk::TRUE,
                    None => info = info.push_next(&mut self.layout),
                }
            }
        }
        if subgroups {
            let vulkan_1_3 = unsafe { chained::<vk::PhysicalDeviceVulkan13Features<'_>>(&info) };
            let own = unsafe { chained::<vk::PhysicalDeviceSubgroupSizeControlFeatures<'_>>(&info) };
            match (vulkan_1_3, own) {
                (Some(there), _) => {
                    there.subgroup_size_control = vk::TRUE;
                    there.compute_full_subgroups = vk::TRUE;
                }
                (None, Some(there)) => {
                    there.subgroup_size_control = vk::TRUE;
                    there.compute_full_subgroups = vk::TRUE;
                }
                (None, None) => info = info.push_next(&mut self.subgroups),
            }
        }
        if reconvergence {
            match unsafe { chained::<vk::PhysicalDeviceShaderMaximalReconvergenceFeaturesKHR<'_>>(&info) } {
                Some(there) => there.shader_maximal_reconvergence = vk::TRUE,
                None => info = info.push_next(&mut self.reconvergence),
            }
        }
        if int64 {
            match unsafe { chained::<vk::PhysicalDeviceFeatures2<'_>>(&info) } {
                Some(there) => there.features.shader_int64 = vk::TRUE,
                None => {
                    // Vulkan takes one or the other.
                    if let Some(&given) = unsafe { info.p_enabled_features.as_ref() } {
                        self.vulkan_1_0.features = given.shader_int64(true);
                        info.p_enabled_features = std::ptr::null();
                    }
                    info = info.push_next(&mut self.vulkan_1_0);
                }
            }
        }
        info
    }
}

/// The structure of type `T` behind `info`.
///
/// # Safety
/// As [`Features::merge_into`]; nothing else refers to the structure while the reference lives.
unsafe fn chained<'a, T: vk::TaggedStructure + vk::ExtendsDeviceCreateInfo>(
    info: &vk::DeviceCreateInfo<'a>,
) -> Option<&'a mut T> {
    let mut next = info.p_next.cast_mut().cast::<vk::BaseOutStructure<'a>>();
    while !next.is_null() {
        // SAFETY: the caller's promise; every structure of Vulkan's begins as this one does.
        let there = unsafe { next.read() };
        if there.s_type == T::STRUCTURE_TYPE {
            // SAFETY: the type is what it says.
            return Some(unsafe { &mut *next.cast::<T>() });
        }
        next = there.p_next;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Optional = Optional { subgroup_size_control: true, maximal_reconvergence: true, int64: true };

    fn types(info: &vk::DeviceCreateInfo<'_>) -> Vec<vk::StructureType> {
        let mut types = Vec::new();
        let mut next = info.p_next.cast::<vk::BaseInStructure<'_>>();
        while !next.is_null() {
            // SAFETY: the tests chain structures that live.
            let there = unsafe { next.read() };
            types.push(there.s_type);
            next = there.p_next;
        }
        types
    }

    #[test]
    fn merged_features_are_enabled_in_the_structures_that_are_there_and_the_others_are_chained() {
        let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
        let mut memory_model = vk::PhysicalDeviceVulkanMemoryModelFeatures::default();
        let mut subgroups = vk::PhysicalDeviceSubgroupSizeControlFeatures::default().subgroup_size_control(true);
        let mut features = Features::with(ALL);
        let info = vk::DeviceCreateInfo::default()
            .push_next(&mut timeline)
            .push_next(&mut memory_model)
            .push_next(&mut subgroups);
        // SAFETY: `push_next` has chained what is there.
        let info = unsafe { features.merge_into(info) };
        let mut types = types(&info);
        let count = types.len();
        types.sort_unstable();
        types.dedup();
        assert_eq!(types.len(), count, "each structure stands once in a chain");
        assert_eq!(count, 7, "three were there, four are new: {types:?}");
        assert!(!types.contains(&vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES), "it excludes the others");
        assert_eq!([memory_model.vulkan_memory_model, memory_model.vulkan_memory_model_device_scope], [vk::TRUE; 2]);
        assert_eq!([subgroups.subgroup_size_control, subgroups.compute_full_subgroups], [vk::TRUE; 2]);
        assert_eq!(timeline.timeline_semaphore, vk::TRUE);
    }

    #[test]
    fn merged_features_are_enabled_in_the_structures_of_vulkan_1_2_and_1_3() {
        let mut vulkan_1_2 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let mut vulkan_1_3 = vk::PhysicalDeviceVulkan13Features::default();
        let mut features = Features::with(Optional::DEFAULT);
        let info = vk::DeviceCreateInfo::default().push_next(&mut vulkan_1_2).push_next(&mut vulkan_1_3);
        // SAFETY: `push_next` has chained what is there.
        let info = unsafe { features.merge_into(info) };
        assert_eq!(types(&info).len(), 2, "nothing is new");
        let wanted = Features::with(Optional::DEFAULT).vulkan_1_2;
        assert_eq!(vulkan_1_2.buffer_device_address, wanted.buffer_device_address);
        assert_eq!(vulkan_1_2.vulkan_memory_model, wanted.vulkan_memory_model);
        assert_eq!(vulkan_1_2.vulkan_memory_model_device_scope, wanted.vulkan_memory_model_device_scope);
        assert_eq!(vulkan_1_2.scalar_block_layout, wanted.scalar_block_layout);
        assert_eq!(vulkan_1_2.timeline_semaphore, vk::TRUE, "what was enabled stays");
        assert_eq!([vulkan_1_3.subgroup_size_control, vulkan_1_3.compute_full_subgroups], [vk::TRUE; 2]);
    }

    #[test]
    fn merging_into_an_empty_chain_chains_what_is_wanted_and_no_more() {
        let mut features = Features::with(Optional::NONE);
        // SAFETY: nothing is chained.
        let info = unsafe { features.merge_into(vk::DeviceCreateInfo::default()) };
        assert_eq!(types(&info).len(), 3, "addresses, memory model and layout");
    }

    #[test]
    fn merged_64_bit_integers_stand_beside_the_features_of_vulkan_1_0_wherever_those_are() {
        let wanted = Optional { int64: true, ..Optional::NONE };
        let clip = vk::PhysicalDeviceFeatures::default().shader_clip_distance(true);
        let mut features = Features::with(wanted);
        // SAFETY: nothing is chained; the given features live.
        let info = unsafe { features.merge_into(vk::DeviceCreateInfo::default().enabled_features(&clip)) };
        assert!(
            info.p_enabled_features.is_null() && types(&info).contains(&vk::StructureType::PHYSICAL_DEVICE_FEATURES_2)
        );
        let merged = features.vulkan_1_0.features;
        assert_eq!([merged.shader_clip_distance, merged.shader_int64], [vk::TRUE; 2]);

        let mut there = vk::PhysicalDeviceFeatures2::default().features(clip);
        let mut features = Features::with(wanted);
        // SAFETY: `push_next` has chained what is there.
        let info = unsafe { features.merge_into(vk::DeviceCreateInfo::default().push_next(&mut there)) };
        assert_eq!(types(&info).iter().filter(|&&t| t == vk::StructureType::PHYSICAL_DEVICE_FEATURES_2).count(), 1);
        assert_eq!([there.features.shader_clip_distance, there.features.shader_int64], [vk::TRUE; 2]);
    }
}
