//! The binary's and the tests' own device: an instance, one queue, an allocator, and submits that wait.
//!
//! Everything here stands on the same public calls that an engine uses with its own device.

use super::{Buffer, Context, ContextDesc, Recorder, Timestamps, TuningChoice, requirements};
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use std::ffi::{CStr, c_void};
use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What [`Device::new`] takes.
#[derive(Debug, Clone, Default)]
pub struct DeviceOptions {
    /// Name (a part of it, any case) or index of the device; otherwise the first discrete, integrated or CPU device.
    pub wanted: Option<String>,
    /// Switch the Khronos validation layers on, synchronisation validation included; any message is an error.
    pub validation: bool,
    /// Enable `VK_KHR_acceleration_structure` and `VK_KHR_ray_query` where the device has them (for the driver's builders).
    pub ray_query: bool,
    /// How work is cut: for what the device is, unless told.
    pub tuning: TuningChoice,
}

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
    /// Whether the driver builds and traces acceleration structures itself.
    pub ray_query: bool,
    /// What it lacks of our requirements; empty if it can be used.
    pub missing: Vec<String>,
    /// Whether it is the one we would pick.
    pub picked: bool,
}

const RAY_QUERY_EXTENSIONS: [&CStr; 3] =
    [ash::khr::acceleration_structure::NAME, ash::khr::ray_query::NAME, ash::khr::deferred_host_operations::NAME];
const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
/// A dispatch that takes longer than this is taken to hang.
const SUBMIT_BOUND: Duration = Duration::from_secs(300);

/// Every Vulkan device of this machine, and which one `wanted` (or our own order) picks.
///
/// # Errors
/// No Vulkan loader, or `wanted` is not there.
pub fn list(wanted: Option<&str>) -> Result<Vec<Found>> {
    let instance = Instance::new(false)?;
    let physical = instance.physical_devices()?;
    let mut found: Vec<_> = physical.iter().enumerate().map(|(index, &p)| instance.describe(index, p)).collect();
    let picked = pick(&found, wanted)?;
    found[picked].picked = true;
    Ok(found)
}

fn pick(found: &[Found], wanted: Option<&str>) -> Result<usize> {
    let available = || found.iter().map(|f| format!("{}: {}", f.index, f.name)).collect::<Vec<_>>().join(", ");
    if found.is_empty() {
        return Err(Error::NoVulkan("the loader knows no device".into()));
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

/// The loader, an instance and the messages of its validation layers.
struct Instance {
    // Dropped last: unloads the Vulkan library.
    entry: ManuallyDrop<ash::Entry>,
    raw: ash::Instance,
    debug: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    has_debug_utils: bool,
    messages: Arc<Mutex<Vec<String>>>,
}

impl Instance {
    fn new(validation: bool) -> Result<Instance> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers, as every Vulkan program does.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::NoVulkan(e.to_string()))?;
        // SAFETY: the loader is loaded.
        let (layers, extensions) = unsafe {
            (
                entry.enumerate_instance_layer_properties().unwrap_or_default(),
                entry.enumerate_instance_extension_properties(None).unwrap_or_default(),
            )
        };
        if validation && !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
            return Err(Error::Argument(
                "the Vulkan validation layers are not installed; on Debian: apt install vulkan-validationlayers".into(),
            ));
        }
        let offers = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let has_debug_utils = validation || offers(ash::ext::debug_utils::NAME);
        let mut names = Vec::new();
        if has_debug_utils {
            names.push(ash::ext::debug_utils::NAME.as_ptr());
        }
        let mut flags = vk::InstanceCreateFlags::empty();
        if offers(ash::khr::portability_enumeration::NAME) {
            names.push(ash::khr::portability_enumeration::NAME.as_ptr());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let layer_names: Vec<_> = validation.then_some(VALIDATION_LAYER.as_ptr()).into_iter().collect();
        let application = vk::ApplicationInfo::default().application_name(c"hedgerow").api_version(vk::API_VERSION_1_3);
        let synchronisation = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&synchronisation);
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags)
            .application_info(&application)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&names);
        if validation {
            info = info.push_next(&mut features);
        }
        // SAFETY: the structures outlive the call.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(Error::vulkan("vkCreateInstance"))?;

        let messages = Arc::new(Mutex::new(Vec::new()));
        let mut debug = None;
        if validation {
            let utils = ash::ext::debug_utils::Instance::new(&entry, &raw);
            let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
                )
                .message_type(
                    vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
                )
                .pfn_user_callback(Some(on_message))
                .user_data(Arc::as_ptr(&messages).cast_mut().cast());
            // SAFETY: the messages outlive the messenger: both are dropped with `self`, the messenger first.
            let messenger = unsafe { utils.create_debug_utils_messenger(&info, None) }
                .map_err(Error::vulkan("vkCreateDebugUtilsMessengerEXT"))?;
            debug = Some((utils, messenger));
        }
        Ok(Instance { entry: ManuallyDrop::new(entry), raw, debug, has_debug_utils, messages })
    }

    fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: the instance is live.
        unsafe { self.raw.enumerate_physical_devices() }.map_err(Error::vulkan("vkEnumeratePhysicalDevices"))
    }

    fn describe(&self, index: usize, physical: vk::PhysicalDevice) -> Found {
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut subgroup);
        // SAFETY: the handles are live and the structures outlive the calls.
        let (memory, extensions) = unsafe {
            self.raw.get_physical_device_properties2(physical, &mut properties);
            (
                self.raw.get_physical_device_memory_properties(physical),
                self.raw.enumerate_device_extension_properties(physical).unwrap_or_default(),
            )
        };
        let properties = properties.properties;
        let text = |c: Result<&CStr, _>| c.unwrap_or(c"?").to_string_lossy().into_owned();
        let offers = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        Found {
            index,
            name: text(properties.device_name_as_c_str().map_err(drop)),
            driver: text(driver.driver_info_as_c_str().map_err(drop)),
            kind: properties.device_type,
            api_version: properties.api_version,
            subgroup_size: subgroup.subgroup_size,
            memory: memory.memory_heaps[..memory.memory_heap_count as usize]
                .iter()
                .filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
                .map(|h| h.size)
                .max()
                .unwrap_or(0),
            ray_query: RAY_QUERY_EXTENSIONS.iter().all(|e| offers(e)),
            missing: match requirements(&self.raw, physical) {
                Ok(_) => Vec::new(),
                Err(Error::Unsupported { missing, .. }) => missing,
                Err(other) => vec![other.to_string()],
            },
            picked: false,
        }
    }
}

impl Drop for Instance {
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
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layers hand over their own data and the pointer given at creation.
    unsafe {
        let messages = &*user.cast::<Mutex<Vec<String>>>();
        let text = (*data).message_as_c_str().map(|m| m.to_string_lossy().into_owned()).unwrap_or_default();
        messages.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push(text);
    }
    vk::FALSE
}

/// The device of the binary and the tests. Derefs to its [`Context`].
///
/// One submit at a time; every submit waits.
pub struct Device {
    // Dropped in `drop`, in this order: context, allocator, device; the instance follows as the last field.
    context: ManuallyDrop<Context>,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    pub(super) raw: ash::Device,
    queue: Mutex<vk::Queue>,
    queue_family: u32,
    pipeline_cache: vk::PipelineCache,
    found: Found,
    physical: vk::PhysicalDevice,
    ray_query: bool,
    instance: Instance,
}

impl Deref for Device {
    type Target = Context;

    fn deref(&self) -> &Context {
        &self.context
    }
}

impl Device {
    /// Opens a device.
    ///
    /// # Errors
    /// No Vulkan, no such device, or it lacks something that [`requirements`] names.
    pub fn new(options: &DeviceOptions) -> Result<Device> {
        let instance = Instance::new(options.validation)?;
        let physical_devices = instance.physical_devices()?;
        let found: Vec<_> = physical_devices.iter().enumerate().map(|(i, &p)| instance.describe(i, p)).collect();
        let found = found[pick(&found, options.wanted.as_deref())?].clone();
        let physical = physical_devices[found.index];
        let mut needs = requirements(&instance.raw, physical)?;

        let priority = [1.0];
        let queue =
            vk::DeviceQueueCreateInfo::default().queue_family_index(needs.queue_family).queue_priorities(&priority);
        let ray_query = options.ray_query && found.ray_query;
        let mut extensions: Vec<_> = needs.extensions.iter().map(|e| e.as_ptr()).collect();
        let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut queries = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
        let queues = [queue];
        if ray_query {
            extensions.extend(RAY_QUERY_EXTENSIONS.iter().map(|e| e.as_ptr()));
        }
        let mut info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
        if ray_query {
            info = info.push_next(&mut structures).push_next(&mut queries);
        }
        info = needs.features.push_into(info);
        // SAFETY: the structures outlive the call; the device has what is asked for.
        let raw =
            unsafe { instance.raw.create_device(physical, &info, None) }.map_err(Error::vulkan("vkCreateDevice"))?;
        // SAFETY: the queue was asked for above.
        let queue = unsafe { raw.get_device_queue(needs.queue_family, 0) };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: physical,
            debug_settings: Default::default(),
            buffer_device_address: true,
            allocation_sizes: Default::default(),
        })
        .map_err(|e| Error::NoVulkan(e.to_string()))?;
        // SAFETY: the device is live.
        let pipeline_cache = unsafe { raw.create_pipeline_cache(&vk::PipelineCacheCreateInfo::default(), None) }
            .map_err(Error::vulkan("vkCreatePipelineCache"))?;
        let debug_utils = instance.has_debug_utils.then(|| ash::ext::debug_utils::Device::new(&instance.raw, &raw));
        let desc = ContextDesc {
            instance: &instance.raw,
            physical_device: physical,
            device: &raw,
            pipeline_cache,
            debug_utils: debug_utils.as_ref(),
            tuning: options.tuning,
        };
        // SAFETY: created above with what `requirements` asks for; dropped after the context.
        let context = unsafe { Context::new(&desc) }?;
        Ok(Device {
            context: ManuallyDrop::new(context),
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            raw,
            queue: Mutex::new(queue),
            queue_family: needs.queue_family,
            pipeline_cache,
            found,
            physical,
            ray_query,
            instance,
        })
    }

    /// What this device is.
    pub fn found(&self) -> &Found {
        &self.found
    }

    /// The instance, for extensions that are loaded from it.
    pub fn ash_instance(&self) -> &ash::Instance {
        &self.instance.raw
    }

    /// The physical device.
    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.physical
    }

    /// Whether the driver's own acceleration structures are enabled.
    pub fn has_ray_query(&self) -> bool {
        self.ray_query
    }

    /// A buffer of `bytes` bytes (at least 16) that shaders reach by its address and the host by a map. `name` says what for.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffer(&self, name: &str, bytes: u64) -> Result<Buffer<'_>> {
        let mut usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        if self.ray_query {
            usage |= vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
                | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR;
        }
        let bytes = bytes.max(16);
        let too_little = || Error::OutOfMemory { what: name.into(), needed: bytes, available: self.found.memory };
        if bytes > self.found.memory {
            return Err(too_little());
        }
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        // SAFETY: the device is live; the buffer is destroyed on failure or by `Buffer::drop`.
        unsafe {
            let raw = self.raw.create_buffer(&info, None).map_err(|_| too_little())?;
            let requirements = self.raw.get_buffer_memory_requirements(raw);
            // Host-visible memory: on a CPU or an integrated GPU it is the only kind; on a discrete GPU the allocator takes
            // the device-local heap that the host can map, where there is one that large.
            let allocation = self.lock_allocator().allocate(&AllocationCreateDesc {
                name,
                requirements,
                location: MemoryLocation::CpuToGpu,
                linear: true,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            });
            let allocation = match allocation {
                Ok(allocation) => allocation,
                Err(_) => {
                    self.raw.destroy_buffer(raw, None);
                    return Err(too_little());
                }
            };
            if let Err(result) = self.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) {
                self.raw.destroy_buffer(raw, None);
                let _ = self.lock_allocator().free(allocation);
                return Err(Error::vulkan("vkBindBufferMemory")(result));
            }
            let address = self.raw.get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(raw));
            Ok(Buffer { device: self, raw, allocation: Some(allocation), address, bytes })
        }
    }

    /// A buffer that holds `data`.
    ///
    /// # Errors
    /// Too little memory.
    pub fn upload<T: bytemuck::NoUninit>(&self, name: &str, data: &[T]) -> Result<Buffer<'_>> {
        let buffer = self.buffer(name, size_of_val(data) as u64)?;
        buffer.write(data);
        Ok(buffer)
    }

    /// Records with `record`, submits and waits; writes the phases into `timestamps` where given.
    ///
    /// # Errors
    /// Those of `record`; a submit that fails or does not finish; validation messages.
    pub fn run(
        &self,
        timestamps: Option<&mut Timestamps>,
        record: impl FnOnce(&mut Recorder<'_>) -> Result<()>,
    ) -> Result<()> {
        let queue = self.queue.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        // SAFETY: the pool, buffer and fence are made, used and destroyed here; the queue is locked.
        unsafe {
            let pool = self
                .raw
                .create_command_pool(&vk::CommandPoolCreateInfo::default().queue_family_index(self.queue_family), None)
                .map_err(Error::vulkan("vkCreateCommandPool"))?;
            let result = self.run_in(pool, *queue, timestamps, record);
            if !matches!(result, Err(Error::Timeout { .. })) {
                self.raw.destroy_command_pool(pool, None);
            }
            result?;
        }
        self.validation_messages()
    }

    unsafe fn run_in(
        &self,
        pool: vk::CommandPool,
        queue: vk::Queue,
        timestamps: Option<&mut Timestamps>,
        record: impl FnOnce(&mut Recorder<'_>) -> Result<()>,
    ) -> Result<()> {
        // SAFETY: as in `run`.
        unsafe {
            let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let commands =
                self.raw.allocate_command_buffers(&info).map_err(Error::vulkan("vkAllocateCommandBuffers"))?[0];
            let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            self.raw.begin_command_buffer(commands, &begin).map_err(Error::vulkan("vkBeginCommandBuffer"))?;
            let recorder = Recorder::new(&self.context, commands);
            let mut recorder = match timestamps {
                Some(timestamps) => recorder.timed(timestamps),
                None => recorder,
            };
            record(&mut recorder)?;
            drop(recorder);
            // The host reads what the dispatches wrote.
            let to_host = vk::MemoryBarrier::default()
                .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
                .dst_access_mask(vk::AccessFlags::HOST_READ);
            self.raw.cmd_pipeline_barrier(
                commands,
                vk::PipelineStageFlags::ALL_COMMANDS,
                vk::PipelineStageFlags::HOST,
                vk::DependencyFlags::empty(),
                &[to_host],
                &[],
                &[],
            );
            self.raw.end_command_buffer(commands).map_err(Error::vulkan("vkEndCommandBuffer"))?;
            let fence =
                self.raw.create_fence(&vk::FenceCreateInfo::default(), None).map_err(Error::vulkan("vkCreateFence"))?;
            let buffers = [commands];
            let submit = vk::SubmitInfo::default().command_buffers(&buffers);
            let done =
                self.raw.queue_submit(queue, &[submit], fence).map_err(Error::vulkan("vkQueueSubmit")).and_then(|()| {
                    match self.raw.wait_for_fences(&[fence], true, SUBMIT_BOUND.as_nanos() as u64) {
                        Err(vk::Result::TIMEOUT) => {
                            Err(Error::Timeout { what: "a submit".into(), seconds: SUBMIT_BOUND.as_secs() })
                        }
                        other => other.map_err(Error::vulkan("vkWaitForFences")),
                    }
                });
            if !matches!(done, Err(Error::Timeout { .. })) {
                self.raw.destroy_fence(fence, None);
            }
            done
        }
    }

    /// What the validation layers have said since the last call.
    ///
    /// # Errors
    /// [`Error::Validation`] with the messages, if there are any.
    pub fn validation_messages(&self) -> Result<()> {
        let messages =
            std::mem::take(&mut *self.instance.messages.lock().unwrap_or_else(|poisoned| poisoned.into_inner()));
        if messages.is_empty() { Ok(()) } else { Err(Error::Validation(messages.join("\n"))) }
    }

    pub(super) fn lock_allocator(&self) -> std::sync::MutexGuard<'_, Allocator> {
        self.allocator.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: buffers borrow the device, so none is left; nothing runs, as every submit waited (or timed out, and then
        // the wait here gives the driver its chance to end).
        unsafe {
            let _ = self.raw.device_wait_idle();
            ManuallyDrop::drop(&mut self.context);
            ManuallyDrop::drop(&mut self.allocator);
            self.raw.destroy_pipeline_cache(self.pipeline_cache, None);
            self.raw.destroy_device(None);
        }
    }
}
