//! The machine's Vulkan devices: the loader, an instance with the messages of its validation layers, and which device to take.

use super::memory::largest_local_heap;
use super::{DriverTracing, Validation, locked, properties};
use crate::{Error, Result};
use ash::vk::{self, DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as MessageType};
use hedgerow::gpu::{Optional, Workarounds, requirements};
use std::ffi::{CStr, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::sync::{Arc, Mutex};

/// One Vulkan device of this machine.
#[derive(Debug, Clone)]
pub struct Found {
    /// Position in the driver's list, as `--device` takes it.
    pub index: usize,
    /// The device's name.
    pub name: String,
    /// Driver name and version, as the driver says them.
    pub driver: String,
    /// Discrete, integrated, CPU…
    pub kind: vk::PhysicalDeviceType,
    /// Vulkan version of the device.
    pub api_version: u32,
    /// Subgroup size.
    pub subgroup_size: u32,
    /// Bytes of the largest device-local heap.
    pub memory: u64,
    /// How rays can be traced through the driver's own acceleration structures, the better way first; empty if it has none.
    pub driver_tracing: Vec<DriverTracing>,
    /// What its driver's faults need.
    pub workarounds: Workarounds,
    /// What it has of what is optional.
    pub optional: Optional,
    /// What it lacks of our requirements; empty if it can be used.
    pub missing: Vec<String>,
    /// Whether it is the one we would pick.
    pub picked: bool,
}

/// The first header of Vulkan with `VK_KHR_shader_maximal_reconvergence`.
const MAXIMAL_RECONVERGENCE_SINCE: u32 = vk::make_api_version(0, 1, 3, 276);
const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
/// The loader takes drivers from the files that these name, and no others where one of the first two is set.
const DRIVER_VARIABLES: [&str; 3] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "VK_ADD_DRIVER_FILES"];

/// Every Vulkan device of this machine, and which one `wanted` (or our own order) picks.
///
/// # Errors
/// No Vulkan loader, no device, or `wanted` is not there.
pub fn list(wanted: Option<&str>) -> Result<Vec<Found>> {
    let instance = VulkanInstance::new(Validation::Off)?;
    let mut found: Vec<_> = instance.devices()?.into_iter().map(|(_, found)| found).collect();
    let picked = pick(&found, wanted)?;
    found[picked].picked = true;
    Ok(found)
}

/// The position of the device to take.
pub(super) fn pick(found: &[Found], wanted: Option<&str>) -> Result<usize> {
    let available = || found.iter().map(|f| format!("{}: {}", f.index, f.name)).collect::<Vec<_>>().join(", ");
    if found.is_empty() {
        return Err(no_device("the loader knows no device"));
    }
    if let Some(asked) = wanted.filter(|w| !w.is_empty()) {
        let by_index = asked.parse::<usize>().ok().filter(|&i| i < found.len());
        let by_name = || found.iter().position(|f| f.name.to_lowercase().contains(&asked.to_lowercase()));
        return by_index
            .or_else(by_name)
            .ok_or_else(|| Error::NoSuchDevice { asked: asked.into(), available: available() });
    }
    let rank = |f: &Found| match f.kind {
        _ if !f.missing.is_empty() => 9,
        vk::PhysicalDeviceType::DISCRETE_GPU => 0,
        vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
        vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
        vk::PhysicalDeviceType::CPU => 3,
        _ => 4,
    };
    Ok(found.iter().min_by_key(|f| rank(f)).expect("not empty").index)
}

/// Why there is no device: a variable of the environment that leads nowhere, or what the loader says.
fn no_device(why: &str) -> Error {
    let set = DRIVER_VARIABLES.iter().filter_map(|&name| Some((name, std::env::var(name).ok()?)));
    let files =
        set.flat_map(|(name, value)| std::env::split_paths(&value).map(|path| (name, path)).collect::<Vec<_>>());
    let missing: Vec<_> = files.filter(|(_, path)| !path.as_os_str().is_empty() && !Path::exists(path)).collect();
    if missing.is_empty() {
        return Error::NoVulkan(why.into());
    }
    let name_each = missing.iter().map(|(name, path)| format!("{name} names {}", path.display()));
    Error::Argument(format!(
        "{why}: {}, which is not there; name the driver's json file, or unset the variable",
        name_each.collect::<Vec<_>>().join(" and ")
    ))
}

/// The loader, an instance and the messages of its validation layers.
pub(super) struct VulkanInstance {
    // Dropped last: unloads the Vulkan library.
    entry: ManuallyDrop<ash::Entry>,
    pub raw: ash::Instance,
    debug: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub has_debug_utils: bool,
    /// The version of Vulkan that the validation layers were written for, where they are on.
    layers: Option<u32>,
    messages: Arc<Mutex<Vec<String>>>,
}

impl VulkanInstance {
    pub fn new(validation: Validation) -> Result<VulkanInstance> {
        let (of_shaders, validation) = (validation == Validation::All, validation != Validation::Off);
        // SAFETY: loading the system's Vulkan loader runs its initialisers, as every Vulkan program does.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::NoVulkan(e.to_string()))?;
        // SAFETY: the loader is loaded.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
        // SAFETY: as above.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        let layer = layers.iter().find(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER));
        if validation && layer.is_none() {
            return Err(Error::Argument(
                "the Vulkan validation layers are not installed; on Debian: apt install vulkan-validationlayers".into(),
            ));
        }
        let offers = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let has_debug_utils = validation || offers(ash::ext::debug_utils::NAME);
        let mut names: Vec<_> = has_debug_utils.then_some(ash::ext::debug_utils::NAME.as_ptr()).into_iter().collect();
        let mut flags = vk::InstanceCreateFlags::empty();
        if offers(ash::khr::portability_enumeration::NAME) {
            names.push(ash::khr::portability_enumeration::NAME.as_ptr());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let layer_names: Vec<_> = validation.then_some(VALIDATION_LAYER.as_ptr()).into_iter().collect();
        let application = vk::ApplicationInfo::default().application_name(c"hedgerow").api_version(vk::API_VERSION_1_3);
        let synchronisation = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let shaders = [vk::ValidationFeatureDisableEXT::SHADERS];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&synchronisation);
        if !of_shaders {
            features = features.disabled_validation_features(&shaders);
        }
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags)
            .application_info(&application)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&names);
        if validation {
            info = info.push_next(&mut features);
        }
        // SAFETY: the structures outlive the call.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => no_device("the loader found no driver"),
            other => Error::vulkan("vkCreateInstance")(other),
        })?;

        let messages = Arc::new(Mutex::new(Vec::new()));
        let mut debug = None;
        if validation {
            let utils = ash::ext::debug_utils::Instance::new(&entry, &raw);
            let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(Severity::ERROR | Severity::WARNING)
                .message_type(MessageType::VALIDATION | MessageType::PERFORMANCE)
                .pfn_user_callback(Some(on_message))
                .user_data(Arc::as_ptr(&messages).cast_mut().cast());
            // SAFETY: the messages outlive the messenger: both are dropped with `self`, the messenger first.
            let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }
                .map_err(Error::vulkan("vkCreateDebugUtilsMessengerEXT"))?;
            debug = Some((utils, messenger));
        }
        let layers = layer.filter(|_| validation).map(|layer| layer.spec_version);
        Ok(VulkanInstance { entry: ManuallyDrop::new(entry), raw, debug, has_debug_utils, layers, messages })
    }

    /// Validation layers complain of extensions that are younger than they are.
    pub fn without_what_layers_do_not_know(&self, optional: Optional) -> Optional {
        let knows = |version: u32| self.layers.is_none_or(|layers| layers >= version);
        let known = Optional { maximal_reconvergence: knows(MAXIMAL_RECONVERGENCE_SINCE), ..optional };
        optional.and(known)
    }

    /// Every device, and what it is.
    pub fn devices(&self) -> Result<Vec<(vk::PhysicalDevice, Found)>> {
        // SAFETY: the instance is live.
        let physical = unsafe { self.raw.enumerate_physical_devices() };
        let physical = physical.map_err(|result| match result {
            vk::Result::ERROR_INITIALIZATION_FAILED => no_device("no driver could be loaded"),
            other => Error::vulkan("vkEnumeratePhysicalDevices")(other),
        })?;
        let described = |(index, physical)| (physical, self.describe(index, physical));
        Ok(physical.into_iter().enumerate().map(described).collect())
    }

    /// What the validation layers have said since the last call.
    pub fn take_messages(&self) -> Vec<String> {
        std::mem::take(&mut *locked(&self.messages))
    }

    fn describe(&self, index: usize, physical: vk::PhysicalDevice) -> Found {
        let driver: vk::PhysicalDeviceDriverProperties<'_> = properties(&self.raw, physical);
        let subgroup: vk::PhysicalDeviceSubgroupProperties<'_> = properties(&self.raw, physical);
        // SAFETY: the handles are live.
        let properties = unsafe { self.raw.get_physical_device_properties(physical) };
        // SAFETY: as above.
        let memory = unsafe { self.raw.get_physical_device_memory_properties(physical) };
        let text = |c: Result<&CStr, _>| c.unwrap_or(c"?").to_string_lossy().into_owned();
        let (optional, missing) = match requirements(&self.raw, physical) {
            Ok(needs) => (needs.available, Vec::new()),
            Err(hedgerow::Error::Unsupported { missing, .. }) => (Optional::NONE, missing),
            Err(other) => (Optional::NONE, vec![other.to_string()]),
        };
        Found {
            index,
            name: text(properties.device_name_as_c_str().map_err(drop)),
            driver: text(driver.driver_info_as_c_str().map_err(drop)),
            kind: properties.device_type,
            api_version: properties.api_version,
            subgroup_size: subgroup.subgroup_size,
            memory: largest_local_heap(&memory).unwrap_or(0),
            workarounds: Workarounds::of_driver(driver.driver_id, properties.driver_version),
            driver_tracing: DriverTracing::of(&self.raw, physical),
            optional,
            missing,
            picked: false,
        }
    }
}

impl Drop for VulkanInstance {
    fn drop(&mut self) {
        // SAFETY: everything made from the instance is gone; the entry is not used afterwards.
        unsafe {
            if let Some((utils, messenger)) = self.debug.take() {
                utils.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
            ManuallyDrop::drop(&mut self.entry);
        }
    }
}

unsafe extern "system" fn on_message(
    _severity: Severity,
    _types: MessageType,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layers hand over their own data and the pointer given at creation.
    unsafe {
        let messages = &*user.cast::<Mutex<Vec<String>>>();
        let text = (*data).message_as_c_str().map(|m| m.to_string_lossy().into_owned()).unwrap_or_default();
        locked(messages).push(text);
    }
    vk::FALSE
}
