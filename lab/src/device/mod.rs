//! The binary's and the tests' own device: one queue, an allocator, and submits that wait.
//!
//! Everything here stands on the same public calls that an engine uses with its own device.

mod buffer;
mod driver_rays;
mod driver_tracing;
mod instance;
mod memory;
pub mod probe;
mod restrict;

pub use buffer::Buffer;
pub use driver_rays::DriverRays;
pub use driver_tracing::{DriverTracing, driver_is_missing};
pub use instance::{Found, list};
pub use restrict::Restrict;

use crate::{Error, Result};
use ash::vk;
use driver_rays::RayPipeline;
use driver_tracing::DriverFeatures;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use hedgerow::gpu::{Context, ContextDesc, Optional, Recorder, Timestamps, TuningChoice, requirements};
use instance::{VulkanInstance, pick};
use memory::Memory;
use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::sync::{Mutex, MutexGuard, OnceLock};
use std::time::{Duration, Instant};

/// What the Khronos validation layers look at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Validation {
    /// Nothing: the layers stay off.
    #[default]
    Off,
    /// Calls and synchronisation. Shaders are not looked at: each pipeline would be, anew in every process, which takes as long as a
    /// driver takes to make it.
    Calls,
    /// Shaders, too.
    All,
}

/// What [`Device::new`] takes.
#[derive(Debug, Clone, Default)]
pub struct DeviceOptions {
    /// Name (a part of it, any case) or index of the device; otherwise the first discrete, integrated or CPU device.
    pub wanted: Option<String>,
    /// What the Khronos validation layers look at; any message is an error.
    pub validation: Validation,
    /// Enable the driver's own acceleration structures where it has them, to be traced like this: [`DriverTracing::Query`] falls
    /// back on pipelines, [`DriverTracing::Pipeline`] is meant.
    pub driver_tracing: Option<DriverTracing>,
    /// How work is cut: by default for the kind of device.
    pub tuning: TuningChoice,
    /// Enable maximal reconvergence where the device has it.
    pub maximal_reconvergence: bool,
    /// What of the device is not used: for tests.
    pub restrict: Restrict,
}

/// A dispatch that takes longer than this is taken to hang.
const SUBMIT_BOUND: Duration = Duration::from_secs(300);

/// The device of the binary and the tests. Derefs to its [`Context`].
///
/// One submit at a time; every submit waits.
pub struct Device {
    // Dropped in `drop`, in this order: context, allocator, device; the instance follows as the last field.
    context: ManuallyDrop<Context>,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    raw: ash::Device,
    queue: Mutex<vk::Queue>,
    queue_family: u32,
    pipeline_cache: vk::PipelineCache,
    found: Found,
    physical: vk::PhysicalDevice,
    driver_tracing: Option<DriverTracing>,
    /// For the closest hit, and for any.
    ray_pipelines: [OnceLock<RayPipeline>; 2],
    /// Whether the host maps all memory, or stages what it writes and reads.
    maps_memory: bool,
    /// Whether what is recorded runs.
    submits: bool,
    /// Buffers that the host maps, of [`memory::STAGING`]; each is made when first used.
    staging: Mutex<[Option<Memory>; 2]>,
    instance: VulkanInstance,
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
        let instance = VulkanInstance::new(options.validation)?;
        let (handles, found): (Vec<_>, Vec<_>) = instance.devices()?.into_iter().unzip();
        let picked = pick(&found, options.wanted.as_deref())?;
        let (physical, found) = (handles[picked], found[picked].clone());
        let needs = requirements(&instance.raw, physical)?;
        let wanted =
            Optional { maximal_reconvergence: options.maximal_reconvergence, int64: true, ..Optional::DEFAULT };
        let optional = instance.without_what_layers_do_not_know(options.restrict.optional(wanted));
        let mut needs = needs.only(optional);

        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(needs.queue_family).queue_priorities(&[1.0])];
        let driver_tracing = options.driver_tracing.and_then(|way| way.among(&found.driver_tracing));
        let of_the_driver = driver_tracing.into_iter().flat_map(DriverTracing::extensions);
        let extensions: Vec<_> = needs.extensions.iter().copied().chain(of_the_driver).map(|e| e.as_ptr()).collect();
        let mut features = DriverFeatures::default();
        let mut info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
        if let Some(way) = driver_tracing {
            info = features.push_into(way, info);
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
            optional: needs.optional,
            tuning: options.tuning,
        };
        // SAFETY: created above with what `requirements` asks for; dropped after the context.
        let context = unsafe { Context::limited(&desc, |limits| options.restrict.limit(limits)) }?;
        Ok(Device {
            context: ManuallyDrop::new(context),
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            raw,
            queue: Mutex::new(queue),
            queue_family: needs.queue_family,
            pipeline_cache,
            found,
            physical,
            driver_tracing,
            ray_pipelines: Default::default(),
            maps_memory: !options.restrict.staged && memory::is_mapped(&instance.raw, physical),
            submits: !options.restrict.unsubmitted,
            staging: Mutex::default(),
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

    /// How rays are traced through the driver's own acceleration structures, if those are enabled.
    pub fn driver_tracing(&self) -> Option<DriverTracing> {
        self.driver_tracing
    }

    /// The pipeline that traces rays through them, made when first asked for.
    fn ray_pipeline(&self, any_hit: bool) -> Result<&RayPipeline> {
        let place = &self.ray_pipelines[usize::from(any_hit)];
        if let Some(made) = place.get() {
            return Ok(made);
        }
        if let Err(second) = place.set(RayPipeline::new(self, any_hit)?) {
            // Another thread was faster.
            second.destroy(self);
        }
        Ok(place.get().expect("just set"))
    }

    /// Whether the host maps the memory of buffers; otherwise [`Buffer::write`] and [`Buffer::read`] copy through staging memory.
    pub fn maps_memory(&self) -> bool {
        self.maps_memory
    }

    /// Bytes that one buffer may have, at most.
    fn largest_allocation(&self) -> u64 {
        let limits: vk::PhysicalDeviceMaintenance3Properties<'_> = properties(&self.instance.raw, self.physical);
        limits.max_memory_allocation_size.min(self.found.memory)
    }

    /// A buffer of `bytes` bytes (at least 16) that shaders reach by its address. `name` says what for.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffer(&self, name: &str, bytes: u64) -> Result<Buffer<'_>> {
        let mut usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        if self.driver_tracing.is_some() {
            usage |= vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
                | vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR;
        }
        let bytes = bytes.max(16);
        let location = if self.maps_memory { MemoryLocation::CpuToGpu } else { MemoryLocation::GpuOnly };
        let memory = self.memory(name, bytes, usage, location)?;
        Ok(Buffer { device: self, address: self.address_of(&memory), memory: Some(memory), bytes })
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
        mut timestamps: Option<&mut Timestamps>,
        record: impl FnOnce(&mut Recorder<'_>) -> hedgerow::Result<()>,
    ) -> Result<()> {
        let waited = self.submit(|commands| {
            // SAFETY: the command buffer is being recorded, by this call alone, and the submit is waited for.
            let recorder = unsafe { Recorder::new(&self.context, commands) };
            let mut recorder = match timestamps.as_deref_mut() {
                Some(timestamps) => recorder.timed(timestamps),
                None => recorder,
            };
            Ok(record(&mut recorder)?)
        })?;
        if let Some(timestamps) = timestamps {
            timestamps.waited(waited);
        }
        self.validation_messages()
    }

    /// Submits what `record` records and waits for it. What it wrote may then be read by the host and by later submits. Returns how
    /// long that took.
    fn submit(&self, record: impl FnOnce(vk::CommandBuffer) -> Result<()>) -> Result<Duration> {
        // SAFETY: the pool is used by this call alone, and freed once what it recorded is done.
        unsafe {
            let (pool, commands) = self.begun()?;
            let result = record(commands).and_then(|()| self.submitted(commands));
            if !matches!(result, Err(Error::Timeout { .. })) {
                self.raw.destroy_command_pool(pool, None);
            }
            result
        }
    }

    /// A pool, and a command buffer of it that records.
    unsafe fn begun(&self) -> Result<(vk::CommandPool, vk::CommandBuffer)> {
        // SAFETY: the device is live; the pool is destroyed on failure, or by `submit`.
        unsafe {
            let of_family = vk::CommandPoolCreateInfo::default().queue_family_index(self.queue_family);
            let pool = self.raw.create_command_pool(&of_family, None).map_err(Error::vulkan("vkCreateCommandPool"))?;
            let begin = || -> Result<vk::CommandBuffer> {
                let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
                let commands =
                    self.raw.allocate_command_buffers(&info).map_err(Error::vulkan("vkAllocateCommandBuffers"))?[0];
                let once = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
                self.raw.begin_command_buffer(commands, &once).map_err(Error::vulkan("vkBeginCommandBuffer"))?;
                Ok(commands)
            };
            let commands = begin().inspect_err(|_| self.raw.destroy_command_pool(pool, None))?;
            Ok((pool, commands))
        }
    }

    /// Ends what is recorded, submits it and waits.
    unsafe fn submitted(&self, commands: vk::CommandBuffer) -> Result<Duration> {
        let visible = vk::AccessFlags::HOST_READ | vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE;
        let barrier =
            vk::MemoryBarrier::default().src_access_mask(vk::AccessFlags::MEMORY_WRITE).dst_access_mask(visible);
        let before = vk::PipelineStageFlags::ALL_COMMANDS;
        let after = vk::PipelineStageFlags::HOST | vk::PipelineStageFlags::ALL_COMMANDS;
        let no_flags = vk::DependencyFlags::empty();
        // SAFETY: as in `submit`.
        unsafe {
            self.raw.cmd_pipeline_barrier(commands, before, after, no_flags, &[barrier], &[], &[]);
            self.raw.end_command_buffer(commands).map_err(Error::vulkan("vkEndCommandBuffer"))?;
        }
        if !self.submits {
            return Ok(Duration::ZERO);
        }
        let queue = locked(&self.queue);
        // SAFETY: as in `submit`; the queue is locked.
        unsafe {
            let fence =
                self.raw.create_fence(&vk::FenceCreateInfo::default(), None).map_err(Error::vulkan("vkCreateFence"))?;
            let buffers = [commands];
            let info = vk::SubmitInfo::default().command_buffers(&buffers);
            let begin = Instant::now();
            let submitted = self.raw.queue_submit(*queue, &[info], fence).map_err(Error::vulkan("vkQueueSubmit"));
            let wait = || self.raw.wait_for_fences(&[fence], true, SUBMIT_BOUND.as_nanos() as u64);
            let done = submitted.and_then(|()| match wait() {
                Err(vk::Result::TIMEOUT) => {
                    Err(Error::Timeout { what: "a submit".into(), seconds: SUBMIT_BOUND.as_secs() })
                }
                other => other.map_err(Error::vulkan("vkWaitForFences")),
            });
            if !matches!(done, Err(Error::Timeout { .. })) {
                self.raw.destroy_fence(fence, None);
            }
            done.map(|()| begin.elapsed())
        }
    }

    /// What times are by: `device` where the queue has timestamps, otherwise `wall`.
    pub fn timer(&self) -> &'static str {
        if self.limits.timestamp_bits > 0 { "device" } else { "wall" }
    }

    /// What the validation layers have said since the last call.
    ///
    /// # Errors
    /// [`Error::Validation`] with the messages, if there are any.
    pub fn validation_messages(&self) -> Result<()> {
        let messages = self.instance.take_messages();
        if messages.is_empty() { Ok(()) } else { Err(Error::Validation(messages.join("\n"))) }
    }
}

/// What a lock guards, even where a thread panicked that held it.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// What a physical device says of itself in one of Vulkan's structures.
fn properties<P: vk::ExtendsPhysicalDeviceProperties2 + Default>(
    instance: &ash::Instance,
    physical_device: vk::PhysicalDevice,
) -> P {
    let mut wanted = P::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut wanted);
    // SAFETY: the handles are live; the structures outlive the call.
    unsafe { instance.get_physical_device_properties2(physical_device, &mut all) };
    wanted
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: buffers borrow the device, so none is left; nothing runs, as every submit waited (or timed out, and then
        // the wait here gives the driver its chance to end).
        unsafe {
            let _ = self.raw.device_wait_idle();
            let pipelines = std::mem::take(&mut self.ray_pipelines);
            pipelines.into_iter().filter_map(OnceLock::into_inner).for_each(|pipeline| pipeline.destroy(self));
            self.release_staging();
            ManuallyDrop::drop(&mut self.context);
            ManuallyDrop::drop(&mut self.allocator);
            self.raw.destroy_pipeline_cache(self.pipeline_cache, None);
            self.raw.destroy_device(None);
        }
    }
}
