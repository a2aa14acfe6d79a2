//! The library on a device that somebody made: limits and pipelines, nothing else.

use super::execution_modes::ExecutionModes;
use super::requirements::{self, Optional, SubgroupSizes};
use super::shaders::{Shader, Takes};
use super::{Tuning, TuningChoice, Workarounds, lanes, longs, specialise};
use crate::{Error, Result};
use ash::vk;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// What [`Context::new`] takes.
pub struct ContextDesc<'a> {
    /// The instance that the device came from.
    pub instance: &'a ash::Instance,
    /// The device's physical device.
    pub physical_device: vk::PhysicalDevice,
    /// The device, created with everything that [`super::requirements`] asks for.
    pub device: &'a ash::Device,
    /// Where pipelines are cached; null for none. Stays the caller's.
    pub pipeline_cache: vk::PipelineCache,
    /// `VK_EXT_debug_utils` of the device, if each phase shall be labelled.
    pub debug_utils: Option<&'a ash::ext::debug_utils::Device>,
    /// The part of [`super::Requirements::optional`] that the device was created with; [`Optional::NONE`] is always right.
    pub optional: Optional,
    /// How work is cut: by default for the device's kind.
    pub tuning: TuningChoice,
}

impl<'a> ContextDesc<'a> {
    /// A description without a pipeline cache and labels, and with work cut for the device's kind. Other fields can be set:
    /// `ContextDesc { pipeline_cache, ..ContextDesc::new(…) }`.
    pub fn new(
        instance: &'a ash::Instance,
        physical_device: vk::PhysicalDevice,
        device: &'a ash::Device,
        optional: Optional,
    ) -> ContextDesc<'a> {
        let (pipeline_cache, tuning) = (vk::PipelineCache::null(), TuningChoice::Auto);
        ContextDesc { instance, physical_device, device, pipeline_cache, debug_utils: None, optional, tuning }
    }
}

/// Properties of the device that builders choose sizes by.
#[derive(Debug, Clone)]
pub struct Limits {
    /// The device's name.
    pub name: String,
    /// CPU, integrated or discrete.
    pub kind: vk::PhysicalDeviceType,
    /// The driver's vendor.
    pub driver: vk::DriverId,
    /// The driver's version, in its own encoding.
    pub driver_version: u32,
    /// The subgroup size the driver reports.
    pub subgroup_size: u32,
    /// The smallest size that a subgroup may have, as far as is known.
    pub subgroup_min: u32,
    /// The largest size that a subgroup may have.
    pub subgroup_max: u32,
    /// Whether workgroups of whole subgroups have full subgroups of exactly `subgroup_size`: it is required when a pipeline is
    /// made, or the device has one size alone. Otherwise a subgroup may be smaller, down to one invocation.
    pub subgroup_is_exact: bool,
    /// Whether shaders may have integers of 64 bits: [`Optional::int64`].
    pub int64: bool,
    /// Whether lanes gather words in one fast instruction, of a CPU's driver: as far as the CPU's vendor tells. GPUs are not asked.
    pub gathers_words_fast: bool,
    /// Cores of this machine, if it is the device: a CPU's driver computes on them.
    pub cores: Option<u32>,
    /// The most invocations of a workgroup.
    pub workgroup_invocations: u32,
    /// The most bytes of shared memory of a workgroup.
    pub shared_memory: u32,
    /// The most workgroups of a dispatch in x.
    pub workgroup_count: u32,
    /// Nanoseconds per tick of a timestamp.
    pub timestamp_period: f32,
    /// Valid bits of a timestamp in the queue family that [`super::requirements`] chooses; 0 if it has none.
    pub timestamp_bits: u32,
}

impl Limits {
    fn of(instance: &ash::Instance, physical_device: vk::PhysicalDevice, optional: Optional) -> Limits {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup).push_next(&mut driver);
        // SAFETY: the handles are the caller's and live.
        let families = unsafe {
            instance.get_physical_device_properties2(physical_device, &mut properties);
            instance.get_physical_device_queue_family_properties(physical_device)
        };
        let properties = properties.properties;
        let sizes = SubgroupSizes::of(instance, physical_device);
        let subgroup_size = subgroup.subgroup_size;
        let family = requirements::queue_family(&families);
        let is_cpu = properties.device_type == vk::PhysicalDeviceType::CPU;
        let cores =
            std::thread::available_parallelism().map_or(1, |cores| u32::try_from(cores.get()).unwrap_or(u32::MAX));
        Limits {
            name: properties.device_name_as_c_str().unwrap_or(c"?").to_string_lossy().into_owned(),
            kind: properties.device_type,
            driver: driver.driver_id,
            driver_version: properties.driver_version,
            subgroup_size,
            subgroup_min: sizes.least,
            subgroup_max: sizes.most.min(128).max(subgroup_size),
            subgroup_is_exact: optional.subgroup_size_control || sizes.least == sizes.most,
            int64: optional.int64,
            gathers_words_fast: is_cpu && host_gathers_words_fast(),
            cores: is_cpu.then_some(cores),
            workgroup_invocations: properties.limits.max_compute_work_group_invocations,
            shared_memory: properties.limits.max_compute_shared_memory_size,
            workgroup_count: properties.limits.max_compute_work_group_count[0],
            timestamp_period: properties.limits.timestamp_period,
            timestamp_bits: family.map_or(0, |family| families[family as usize].timestamp_valid_bits),
        }
    }

    /// Whether a load at an address that is the same for all lanes is one plain load: lavapipe of Mesa 26.1.6 does it, 25.0.7
    /// does not, and those between were not asked.
    pub fn loads_uniform_values_once(&self) -> bool {
        self.driver == vk::DriverId::MESA_LLVMPIPE && vk::api_version_major(self.driver_version) >= 26
    }
}

/// Whether the host's CPU gathers words in one fast instruction, as Intel's do. An AMD EPYC of Zen 3 was measured to gain by fewer gathers.
fn host_gathers_words_fast() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        // The vendor's name, in the order of the registers.
        let name = std::arch::x86_64::__cpuid(0);
        [name.ebx, name.edx, name.ecx].map(u32::to_le_bytes).concat() == b"GenuineIntel"
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// A shader with its specialisation constants: what a pipeline is made of.
///
/// Constant 0 is the workgroup size in x by convention (`local_size_x_id = 0`); the others follow from 1 on.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Kernel {
    shader: &'static Shader,
    constants: Vec<u32>,
    /// For what is left of a dispatch behind its full rows.
    behind_rows: bool,
    /// Many of it, with their arguments in a table.
    by_table: bool,
}

/// The specialisation constants that every pass has: workgroups of a row (glsl/gpu/pass.glsl), and whether the device divides exactly
/// (glsl/gpu/division.glsl).
const GROUPS_OF_A_ROW: u32 = 30;
const DIVISION_IS_EXACT: u32 = 29;

impl Kernel {
    /// `shader` with a workgroup of `workgroup` invocations and the specialisation constants 1, 2, … as given.
    pub fn new(shader: &'static Shader, workgroup: u32, constants: &[u32]) -> Kernel {
        let mut all = vec![workgroup];
        all.extend_from_slice(constants);
        Kernel { shader, constants: all, behind_rows: false, by_table: false }
    }

    /// The same for a dispatch whose workgroups begin behind rows of others.
    pub(super) fn behind_rows(&self) -> Kernel {
        Kernel { behind_rows: true, ..self.clone() }
    }

    /// Many of it, each by a workgroup, with their arguments in a table; `None` where the shader is not made for one workgroup.
    pub(super) fn by_table(&self) -> Option<Kernel> {
        self.shader.by_table.map(|_| Kernel { by_table: true, ..self.clone() })
    }

    /// Little-endian words as bytes.
    fn spirv(&self) -> &'static [u8] {
        self.shader.by_table.filter(|_| self.by_table).unwrap_or(self.shader.spirv)
    }

    /// Whether the shader numbers the workgroups of several rows through.
    pub(super) fn takes_rows(&self) -> bool {
        /// `OpDecorate` of four words with the decoration `SpecId`.
        const DECORATE: u32 = 4 << 16 | 71;
        const SPEC_ID: u32 = 1;
        let words = bytemuck::pod_collect_to_vec::<u8, u32>(self.spirv());
        words.windows(4).any(|w| w[0] == DECORATE && w[2] == SPEC_ID && w[3] == GROUPS_OF_A_ROW)
    }

    /// Whether it belongs to builds of BVHs and what is done to them. Tracers choose how they load, and kd-trees take 1.08 of the time in
    /// elements of 64 bits.
    fn builds_bvhs(&self) -> bool {
        ["bvh/", "accel/"].iter().any(|room| self.shader.name.starts_with(room))
    }

    /// Whether invocations are numbered by their subgroup where a workgroup is one: those of such builds, and what all passes share. Tracers and
    /// builds of kd-trees gain nothing by it.
    fn is_numbered_by_subgroup(&self) -> bool {
        self.builds_bvhs() || self.shader.name.starts_with("gpu/")
    }

    /// The same in workgroups of `workgroup` invocations.
    pub(crate) fn in_workgroups_of(mut self, workgroup: u32) -> Kernel {
        self.constants[0] = workgroup;
        self
    }

    /// What its shader takes of a block of push constants.
    pub(super) fn takes(&self) -> &'static Takes {
        &self.shader.takes
    }

    /// Path of its shader below `glsl/`.
    pub fn name(&self) -> &'static str {
        self.shader.name
    }

    /// The workgroup size in x.
    pub fn workgroup(&self) -> u32 {
        self.constants[0]
    }
}

/// The library's state on one device: pipelines, made when first recorded.
///
/// Safe to share between threads that record. Pipelines that a recording needs and that are not there yet are made first, side by side.
pub struct Context {
    device: ash::Device,
    debug_utils: Option<ash::ext::debug_utils::Device>,
    /// The device's limits.
    pub limits: Limits,
    /// How work is cut for it.
    pub tuning: Tuning,
    /// What its driver's faults require.
    pub workarounds: Workarounds,
    optional: Optional,
    execution_modes: ExecutionModes,
    /// Subgroups of a workgroup, at most, where the size is required.
    subgroups_of_a_workgroup: u32,
    layout: vk::PipelineLayout,
    cache: vk::PipelineCache,
    /// Each with the time that its making took.
    pipelines: Mutex<HashMap<Kernel, (vk::Pipeline, Duration)>>,
}

impl Context {
    /// Wraps the caller's device.
    ///
    /// # Errors
    /// A pipeline layout could not be made.
    ///
    /// # Safety
    /// The device was created from `instance` and `physical_device` with the version, extensions and features that
    /// [`super::requirements`] returned for it, and outlives the context.
    pub unsafe fn new(desc: &ContextDesc<'_>) -> Result<Context> {
        // SAFETY: the caller's promise.
        unsafe { Context::limited(desc, |_| ()) }
    }

    /// The same on a device whose limits are lower than it says.
    ///
    /// # Safety
    /// As [`Context::new`].
    #[doc(hidden)]
    pub unsafe fn limited(desc: &ContextDesc<'_>, limit: impl FnOnce(&mut Limits)) -> Result<Context> {
        let range = vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(super::requirements::PUSH_CONSTANT_BYTES);
        let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(std::slice::from_ref(&range));
        // SAFETY: the device is live by the caller's promise.
        let layout = unsafe { desc.device.create_pipeline_layout(&info, None) }
            .map_err(Error::vulkan("vkCreatePipelineLayout"))?;
        let mut limits = Limits::of(desc.instance, desc.physical_device, desc.optional);
        limit(&mut limits);
        let tuning = Tuning::of(desc.tuning, &limits);
        let floats = tuning.strict_floats.then(|| ExecutionModes::of_floats(desc.instance, desc.physical_device));
        let execution_modes =
            ExecutionModes { maximal_reconvergence: desc.optional.maximal_reconvergence, ..floats.unwrap_or_default() };
        Ok(Context {
            device: desc.device.clone(),
            debug_utils: desc.debug_utils.cloned(),
            tuning,
            workarounds: Workarounds::of(&limits),
            optional: desc.optional,
            execution_modes,
            subgroups_of_a_workgroup: SubgroupSizes::of(desc.instance, desc.physical_device).of_a_workgroup,
            limits,
            layout,
            cache: desc.pipeline_cache,
            pipelines: Mutex::default(),
        })
    }

    /// The device the context was made on.
    pub fn ash_device(&self) -> &ash::Device {
        &self.device
    }

    pub(super) fn layout(&self) -> vk::PipelineLayout {
        self.layout
    }

    pub(super) fn debug_utils(&self) -> Option<&ash::ext::debug_utils::Device> {
        self.debug_utils.as_ref()
    }

    /// Makes the pipelines of `kernels` now instead of when they are first recorded, side by side: a driver takes up to seconds for
    /// one, on one core. For those of whole passes there is [`Recorder::warming`](super::Recorder::warming).
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn warm(&self, kernels: &[Kernel]) -> Result<()> {
        self.make(kernels.iter())
    }

    /// Makes the pipelines that are missing, by a thread for each core.
    pub(super) fn make<'k>(&self, kernels: impl Iterator<Item = &'k Kernel>) -> Result<()> {
        let missing: Vec<&Kernel> = {
            let pipelines = self.made();
            kernels.filter(|kernel| !pipelines.contains_key(kernel)).collect::<HashSet<_>>().into_iter().collect()
        };
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let next = AtomicUsize::new(0);
        let work = || {
            while let Some(kernel) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                self.pipeline(kernel)?;
            }
            Ok(())
        };
        std::thread::scope(|scope| {
            let others: Vec<_> = (1..cores.min(missing.len())).map(|_| scope.spawn(work)).collect();
            let own = work();
            others.into_iter().fold(own, |made, other| made.and(other.join().expect("no pipeline panics")))
        })
    }

    /// All pipelines made so far, and how long each took. Most drivers compile at that point; lavapipe compiles at the first
    /// dispatch.
    pub fn pipelines(&self) -> Vec<(Kernel, Duration)> {
        self.made().iter().map(|(kernel, &(_, time))| (kernel.clone(), time)).collect()
    }

    fn made(&self) -> MutexGuard<'_, HashMap<Kernel, (vk::Pipeline, Duration)>> {
        self.pipelines.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Made if it is not there yet, while other threads make others.
    pub(super) fn pipeline(&self, kernel: &Kernel) -> Result<vk::Pipeline> {
        if let Some(&(pipeline, _)) = self.made().get(kernel) {
            return Ok(pipeline);
        }
        let begin = Instant::now();
        let made = self.create_pipeline(kernel)?;
        let (pipeline, _) = *self.made().entry(kernel.clone()).or_insert((made, begin.elapsed()));
        if pipeline != made {
            // SAFETY: ours, and used by nobody: another thread was faster.
            unsafe { self.device.destroy_pipeline(made, None) };
        }
        Ok(pipeline)
    }

    /// Whether a workgroup of this many invocations consists of full subgroups of the known size.
    fn can_require_subgroups(&self, workgroup: u32) -> bool {
        let size = self.limits.subgroup_size;
        self.optional.subgroup_size_control
            && self.limits.subgroup_is_exact
            && workgroup.is_multiple_of(size)
            && workgroup / size <= self.subgroups_of_a_workgroup
    }

    fn create_pipeline(&self, kernel: &Kernel) -> Result<vk::Pipeline> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(kernel.spirv())).expect("build.rs wrote whole words");
        let of_the_device =
            [(GROUPS_OF_A_ROW, self.limits.workgroup_count), (DIVISION_IS_EXACT, self.tuning.exact_division.into())];
        let constants = (0..).zip(kernel.constants.iter().copied()).chain(of_the_device).collect();
        let mut words = specialise::specialised(&words, &constants);
        if self.tuning.build.in_longs && kernel.builds_bvhs() {
            words = longs::in_longs(&words);
        }
        let is_one_subgroup = kernel.workgroup() == self.limits.subgroup_size;
        if is_one_subgroup && self.can_require_subgroups(kernel.workgroup()) && kernel.is_numbered_by_subgroup() {
            words = lanes::numbered_by_subgroup(&words);
        }
        let words = self.execution_modes.added_to(&words);
        let module_info = vk::ShaderModuleCreateInfo::default().code(&words);
        let mut subgroups = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
            .required_subgroup_size(self.limits.subgroup_size);
        // SAFETY: the device is live; the module is destroyed after the pipeline that used it was made.
        unsafe {
            let module =
                self.device.create_shader_module(&module_info, None).map_err(Error::vulkan("vkCreateShaderModule"))?;
            let mut stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            if self.can_require_subgroups(kernel.workgroup()) {
                stage =
                    stage.flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS).push_next(&mut subgroups);
            }
            let base = if kernel.behind_rows {
                vk::PipelineCreateFlags::DISPATCH_BASE
            } else {
                vk::PipelineCreateFlags::empty()
            };
            let info = vk::ComputePipelineCreateInfo::default().flags(base).stage(stage).layout(self.layout);
            let made = self.device.create_compute_pipelines(self.cache, &[info], None);
            self.device.destroy_shader_module(module, None);
            made.map(|pipelines| pipelines[0]).map_err(|(_, result)| Error::vulkan("vkCreateComputePipelines")(result))
        }
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        let pipelines = self.pipelines.get_mut().unwrap_or_else(|poisoned| poisoned.into_inner());
        // SAFETY: made by this context; the caller has waited for the command buffers that use them.
        unsafe {
            for (_, (pipeline, _)) in pipelines.drain() {
                self.device.destroy_pipeline(pipeline, None);
            }
            self.device.destroy_pipeline_layout(self.layout, None);
        }
    }
}
