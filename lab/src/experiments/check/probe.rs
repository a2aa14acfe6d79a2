//! What queries report, ray by ray: `lab/glsl/measure/probe.comp` in a pipeline of its own, as an engine would have it.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]
use crate::arguments;
use crate::device::Device;
use crate::shaders;
use ash::vk;
use hedgerow::gpu::Recorder;
use hedgerow::gpu::shaders::{Block, Shader};
use hedgerow::trace::tracer::Loads;

/// A ray with its flags, and how its candidates are decided on.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ProbeRay {
    pub origin: [f32; 3],
    pub t_min: f32,
    pub direction: [f32; 3],
    pub t_max: f32,
    pub flags: u32,
    pub mask: u32,
    pub decision: u32,
    pub generated_t: f32,
}

pub const IGNORE: u32 = 0;
pub const CONFIRM: u32 = 1;
pub const CONFIRM_ODD: u32 = 2;
pub const TERMINATE: u32 = 3;

/// Ray flags, as SPIR-V numbers them.
pub mod flags {
    pub const NONE: u32 = 0;
    pub const OPAQUE: u32 = 1;
    pub const NO_OPAQUE: u32 = 2;
    pub const FIRST_HIT: u32 = 4;
    pub const CULL_BACK: u32 = 16;
    pub const CULL_FRONT: u32 = 32;
    pub const CULL_OPAQUE: u32 = 64;
    pub const CULL_NO_OPAQUE: u32 = 128;
    pub const SKIP_TRIANGLES: u32 = 256;
    pub const SKIP_BOXES: u32 = 512;
}

impl ProbeRay {
    /// From `origin` along `direction`, as far as it goes; candidates are confirmed.
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> ProbeRay {
        ProbeRay {
            origin,
            t_min: 0.0,
            direction,
            t_max: 1e30,
            flags: flags::NONE,
            mask: 0xff,
            decision: CONFIRM,
            generated_t: 1.0,
        }
    }

    /// From `origin` to `target`, which is at t = 1, and beyond.
    pub fn to(origin: [f32; 3], target: [f32; 3]) -> ProbeRay {
        ProbeRay::new(origin, std::array::from_fn(|k| target[k] - origin[k]))
    }
}

/// A hit that was committed. `kind` 0: none, 1: a triangle, 2: generated.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Meeting {
    pub kind: u32,
    pub t: f32,
    pub instance: u32,
    pub custom_index: u32,
    pub offset: u32,
    pub geometry: u32,
    pub primitive: u32,
    pub is_front: u32,
    pub barycentrics: [f32; 2],
    pub object_origin: [f32; 3],
    pub object_direction: [f32; 3],
    /// Column by column.
    pub object_to_world: [[f32; 3]; 4],
    pub world_to_object: [[f32; 3]; 4],
}

/// What a query said of a ray.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ProbeReport {
    pub committed: Meeting,
    pub t_min: f32,
    pub flags: u32,
    pub origin: [f32; 3],
    pub direction: [f32; 3],
    pub candidate_count: u32,
    pub candidates: [[u32; 4]; 8],
    pub opaque_boxes: u32,
}

impl ProbeReport {
    /// The candidates in an order that does not depend on the tree.
    pub fn sorted_candidates(&self) -> Vec<[u32; 4]> {
        let mut all: Vec<_> = self.candidates.into_iter().take(self.candidate_count as usize).collect();
        all.sort_unstable();
        all
    }
}

/// What a probe is told of the structures that it queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    Nothing,
    /// `HEDGEROW_ONE_LEVEL`: they are bottom levels.
    OneLevel,
    /// `HEDGEROW_ALL_BUILT` as well: none is null or empty.
    OneLevelBuilt,
}

/// A pipeline of its own, and its layout: neither of them ours.
pub struct Probe {
    device: &'static Device,
    shader: &'static Shader,
    group: u32,
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
}

impl Probe {
    /// Invocations of a workgroup, where it is not one subgroup.
    const GROUP: u32 = 64;
    /// Bytes of push constants that any of its shaders takes.
    const PUSH_BYTES: u32 = 40;

    /// For our structures.
    pub fn ours(device: &'static Device) -> Probe {
        Probe::of(device, &shaders::MEASURE_PROBE)
    }

    /// The same for bottom levels alone.
    pub fn of_one_level(device: &'static Device) -> Probe {
        Probe::with(device, &shaders::MEASURE_PROBE, Probe::GROUP, Told::OneLevel)
    }

    /// The same while another query of each ray goes on, into what turns would be told of. Each time the kind of what that has
    /// committed to, 0 if nothing, is added to `opaque_boxes`.
    pub fn beside_another(device: &'static Device) -> Probe {
        Probe::of(device, &shaders::MEASURE_PROBE_TWO)
    }

    /// The same with several rays for each invocation, in turn.
    pub fn in_turn(device: &'static Device) -> Probe {
        Probe::of(device, &shaders::MEASURE_PROBE_TURNS)
    }

    /// The same with loads lane by lane, where a subgroup is one that can, and the driver takes out what the pipeline's constants leave out:
    /// SwiftShader does not, and follows the paths of sixteen lanes one by one (no end after 230 s).
    pub fn in_lanes(device: &'static Device, told: Told) -> Option<Probe> {
        let limits = &device.limits;
        let can = limits.subgroup_is_exact
            && limits.subgroup_size <= Loads::MAX_LANES
            && limits.driver != vk::DriverId::GOOGLE_SWIFTSHADER;
        can.then(|| Probe::with(device, &shaders::MEASURE_PROBE_TURNS_LANES, limits.subgroup_size, told))
    }

    /// Of a shader with workgroups of 64 and at most 40 bytes of push constants.
    ///
    /// # Panics
    /// The device does not take it.
    pub fn of(device: &'static Device, shader: &'static Shader) -> Probe {
        Probe::with(device, shader, Probe::GROUP, Told::Nothing)
    }

    /// Of workgroups of `group`, which the shader may take as constants 0 and 4; what it is told are constants 5 and 6.
    fn with(device: &'static Device, shader: &'static Shader, group: u32, told: Told) -> Probe {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv)).expect("SPIR-V");
        let raw = device.ash_device();
        let range =
            [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(Self::PUSH_BYTES)];
        // SAFETY: the words are a module that the compiler made, and everything lives as long as the probe.
        unsafe {
            let layout = raw
                .create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&range), None)
                .expect("a layout");
            let module =
                raw.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None).expect("a module");
            let data = [group, u32::from(told != Told::Nothing), u32::from(told == Told::OneLevelBuilt)];
            let entry = |(id, offset)| vk::SpecializationMapEntry { constant_id: id, offset, size: size_of::<u32>() };
            let entries = [(0, 0), (4, 0), (5, 4), (6, 8)].map(entry);
            let constants = vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::bytes_of(&data));
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .specialization_info(&constants)
                .name(c"main");
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
            let pipeline =
                raw.create_compute_pipelines(vk::PipelineCache::null(), &[info], None).expect("a pipeline")[0];
            raw.destroy_shader_module(module, None);
            Probe { device, shader, group, layout, pipeline }
        }
    }

    /// What a query of every ray reports.
    ///
    /// # Panics
    /// The device failed.
    pub fn ask(&self, structure: u64, rays: &[ProbeRay]) -> Vec<ProbeReport> {
        self.ask_told(structure, structure, rays)
    }

    /// The same where turns are told of another structure than the one that rays go into.
    ///
    /// # Panics
    /// The device failed.
    pub fn ask_told(&self, structure: u64, told: u64, rays: &[ProbeRay]) -> Vec<ProbeReport> {
        let ray_buffer = self.device.upload("rays", rays).expect("memory");
        let reports =
            self.device.buffer("reports", size_of::<ProbeReport>() as u64 * rays.len() as u64).expect("memory");
        let count = rays.len() as u32;
        let push = arguments::Probe { structure, told, rays: ray_buffer.address(), reports: reports.address(), count };
        self.dispatch(&push, count);
        reports.read(rays.len())
    }

    /// One invocation for each of `count` rays.
    ///
    /// # Panics
    /// The device failed, or the shader takes other arguments.
    pub fn dispatch<B: Block>(&self, push: &B, count: u32) {
        let push = self.shader.takes.of(push);
        let record = |recorder: &mut Recorder<'_>| {
            let (raw, commands) = (self.device.ash_device(), recorder.commands());
            // SAFETY: the command buffer is being recorded, and the pipeline outlives the submit, which waits.
            unsafe {
                raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, self.pipeline);
                raw.cmd_push_constants(commands, self.layout, vk::ShaderStageFlags::COMPUTE, 0, &push);
                raw.cmd_dispatch(commands, count.div_ceil(self.group), 1, 1);
            }
            Ok(())
        };
        self.device.run(None, record).expect("it traces");
    }
}

impl Drop for Probe {
    fn drop(&mut self) {
        // SAFETY: every submit has been waited for.
        unsafe {
            self.device.ash_device().destroy_pipeline(self.pipeline, None);
            self.device.ash_device().destroy_pipeline_layout(self.layout, None);
        }
    }
}
