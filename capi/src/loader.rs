//! Vulkan's functions, by the caller's `vkGetInstanceProcAddr`: the library links no loader.

use crate::pointers::handle;
use crate::vulkan::{PFN_vkGetInstanceProcAddr, VkDevice, VkInstance};
use hedgerow::ash::{self, ext::debug_utils};
use hedgerow::{Error, Result};
use std::ffi::CStr;

/// What the crate calls of an instance and a device beyond Vulkan 1.0. Calling a function that is not there would abort.
const OF_INSTANCES: [&CStr; 2] = [c"vkGetPhysicalDeviceProperties2", c"vkGetPhysicalDeviceFeatures2"];
const OF_DEVICES: [&CStr; 1] = [c"vkGetBufferDeviceAddress"];

/// The functions of `instance`.
///
/// # Safety
/// Both are null or the caller's, and live.
pub(crate) unsafe fn instance(get: PFN_vkGetInstanceProcAddr, instance: VkInstance) -> Result<ash::Instance> {
    let Some(get) = get else { return Err(Error::Argument("pfnGetInstanceProcAddr is null".into())) };
    let instance = handle(instance, "instance")?;
    // SAFETY: the caller's promise.
    if let Some(name) = OF_INSTANCES.iter().find(|name| unsafe { get(instance, name.as_ptr()) }.is_none()) {
        return Err(lacking("instance", name));
    }
    // SAFETY: the caller's promise.
    Ok(unsafe { ash::Instance::load(&ash::StaticFn { get_instance_proc_addr: get }, instance) })
}

/// The functions of `device`.
///
/// # Safety
/// It is null or was made from `instance`, and lives.
pub(crate) unsafe fn device(instance: &ash::Instance, device: VkDevice) -> Result<ash::Device> {
    let device = handle(device, "device")?;
    // SAFETY: the caller's promise.
    let there = |name: &CStr| unsafe { instance.get_device_proc_addr(device, name.as_ptr()) }.is_some();
    if let Some(name) = OF_DEVICES.iter().find(|name| !there(name)) {
        return Err(lacking("device", name));
    }
    // SAFETY: the caller's promise.
    Ok(unsafe { ash::Device::load(instance.fp_v1_0(), device) })
}

/// The functions of `device` that label phases.
///
/// # Safety
/// As [`instance`] and [`device`].
pub(crate) unsafe fn labels(
    get: PFN_vkGetInstanceProcAddr,
    instance: &ash::Instance,
    device: &ash::Device,
) -> Result<debug_utils::Device> {
    let name = c"vkCmdBeginDebugUtilsLabelEXT".as_ptr();
    // The instance tells whether the extension is enabled; drivers have the function either way, or not at all.
    // SAFETY: the caller's promise.
    let enabled = get.is_some_and(|get| unsafe { get(instance.handle(), name) }.is_some());
    // SAFETY: the caller's promise.
    let there = unsafe { instance.get_device_proc_addr(device.handle(), name) }.is_some();
    if !(enabled && there) {
        return Err(Error::Argument(
            "debugLabels is VK_TRUE and the instance has no VK_EXT_debug_utils; enable it, or set VK_FALSE".into(),
        ));
    }
    Ok(debug_utils::Device::new(instance, device))
}

fn lacking(what: &str, function: &CStr) -> Error {
    let function = function.to_string_lossy();
    Error::Argument(format!(
        "the {what} has no {function}; give VkApplicationInfo::apiVersion at least VK_API_VERSION_1_2"
    ))
}
