//! What a device must have, in the form that `VkDeviceCreateInfo` wants it.

use crate::loader;
use crate::pointers::{handle, place};
use crate::status::status;
use crate::vulkan::{PFN_vkGetInstanceProcAddr, VkInstance, VkPhysicalDevice, VkQueueFlags, VkResult};
use hedgerow::ash::vk;
use hedgerow::gpu::{Features, Optional, requirements};
use hedgerow::{Error, Result};
use std::ffi::{c_char, c_void};

/// What is optional: bits HEDGEROW_OPTIONAL_*. Results are the same without, only slower.
pub type HedgerowOptional = u32;
/// `VK_EXT_subgroup_size_control` with its features `subgroupSizeControl` and `computeFullSubgroups`.
pub const HEDGEROW_OPTIONAL_SUBGROUP_SIZE_CONTROL: HedgerowOptional = 1;
/// `VK_KHR_shader_maximal_reconvergence` with its feature `shaderMaximalReconvergence`. hedgerow_create_requirements leaves it out, as
/// no kernel relies on it: if you enable it, set the bit.
pub const HEDGEROW_OPTIONAL_MAXIMAL_RECONVERGENCE: HedgerowOptional = 2;
/// The feature `shaderInt64`: on CPUs, tracers load elements of 64 bits. hedgerow_create_requirements leaves it out, as it lies in
/// `VkPhysicalDeviceFeatures`, which is yours: if you enable it there, set the bit.
pub const HEDGEROW_OPTIONAL_INT64: HedgerowOptional = 4;

fn bits_of(optional: Optional) -> HedgerowOptional {
    let bit = |has: bool, bit| if has { bit } else { 0 };
    bit(optional.subgroup_size_control, HEDGEROW_OPTIONAL_SUBGROUP_SIZE_CONTROL)
        | bit(optional.maximal_reconvergence, HEDGEROW_OPTIONAL_MAXIMAL_RECONVERGENCE)
        | bit(optional.int64, HEDGEROW_OPTIONAL_INT64)
}

pub(crate) fn optional_of(bits: HedgerowOptional) -> Result<Optional> {
    let optional = Optional {
        subgroup_size_control: bits & HEDGEROW_OPTIONAL_SUBGROUP_SIZE_CONTROL != 0,
        maximal_reconvergence: bits & HEDGEROW_OPTIONAL_MAXIMAL_RECONVERGENCE != 0,
        int64: bits & HEDGEROW_OPTIONAL_INT64 != 0,
    };
    if bits_of(optional) != bits {
        return Err(Error::Argument(format!("optional is {bits:#x}; it must be of the bits HEDGEROW_OPTIONAL_*")));
    }
    Ok(optional)
}

/// What to create a `VkDevice` with. It is the library's memory, until hedgerow_destroy_requirements.
#[repr(C)]
pub struct HedgerowRequirements {
    /// The version for `VkApplicationInfo::apiVersion`, at least.
    pub api_version: u32,
    /// The queue family to take: with `queueFlags` and timestamps, without graphics where there is such a one.
    pub queue_family_index: u32,
    /// What the queue family must have, if the caller takes another.
    pub queue_flags: VkQueueFlags,
    /// For `VkDeviceCreateInfo::enabledExtensionCount`.
    pub enabled_extension_count: u32,
    /// For `VkDeviceCreateInfo::ppEnabledExtensionNames`.
    pub enabled_extension_names: *const *const c_char,
    /// The features to enable: structures for the end of the chain at `VkDeviceCreateInfo::pNext`. If that chain holds a
    /// `VkPhysicalDeviceVulkan12Features` already, set `bufferDeviceAddress`, `vulkanMemoryModel`,
    /// `vulkanMemoryModelDeviceScope` and `scalarBlockLayout` there instead.
    pub features: *mut c_void,
    /// What the extensions and the features hold that is optional, for `HedgerowContextCreateInfo::optional`. Whoever enables
    /// less gives less there.
    pub optional: HedgerowOptional,
}

/// What the caller's pointer points to, and what that points to.
#[repr(C)]
struct Owned {
    // First: a pointer to it is one to the whole.
    given: HedgerowRequirements,
    _names: Vec<*const c_char>,
    features: Features,
}

/// Tells what `physicalDevice` must be created with. `VK_ERROR_FEATURE_NOT_PRESENT` if the device cannot be used: the
/// message lists everything that it lacks.
///
/// # Safety
/// `instance` was created for Vulkan 1.2 or later, `physicalDevice` is of it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_create_requirements(
    pfn_get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    instance: VkInstance,
    physical_device: VkPhysicalDevice,
    pp_requirements: *mut *mut HedgerowRequirements,
) -> VkResult {
    status(|| {
        // SAFETY: the caller's promises.
        let (place, instance) = unsafe {
            (place(pp_requirements, "ppRequirements")?, loader::instance(pfn_get_instance_proc_addr, instance)?)
        };
        let needs = requirements(&instance, handle(physical_device, "physicalDevice")?)?;
        let names: Vec<_> = needs.extensions.iter().map(|name| name.as_ptr()).collect();
        let owned = Box::into_raw(Box::new(Owned {
            given: HedgerowRequirements {
                api_version: needs.api_version,
                queue_family_index: needs.queue_family,
                queue_flags: needs.queue_flags,
                enabled_extension_count: names.len() as u32,
                enabled_extension_names: names.as_ptr(),
                features: std::ptr::null_mut(),
                optional: bits_of(needs.optional),
            },
            _names: names,
            features: needs.features,
        }));
        // SAFETY: just made. The chain's pointers into it hold from here on, where nothing moves any more.
        unsafe {
            let chain = (*owned).features.push_into(vk::DeviceCreateInfo::default()).p_next;
            (*owned).given.features = chain.cast_mut();
        }
        place.write(owned.cast());
        Ok(())
    })
}

/// Frees what hedgerow_create_requirements made; null is ignored.
///
/// # Safety
/// No `VkDeviceCreateInfo` that is still used points into it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_destroy_requirements(requirements: *mut HedgerowRequirements) {
    if !requirements.is_null() {
        // SAFETY: `hedgerow_create_requirements` gave it out, which is the beginning of an `Owned`.
        drop(unsafe { Box::from_raw(requirements.cast::<Owned>()) });
    }
}
