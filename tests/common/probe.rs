//! What a ray query reports: `tests/shaders/probe.comp` in a pipeline of its own, as an engine would have it; and what the header
//! for kd-trees does, `kd_probe.comp`.

use super::device;
use hedgerow::ash::{self, vk};
use hedgerow::gpu::Recorder;
use hedgerow::trace::{Hit, Ray};

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
pub struct Report {
    pub committed: Meeting,
    pub t_min: f32,
    pub flags: u32,
    pub origin: [f32; 3],
    pub direction: [f32; 3],
    pub candidate_count: u32,
    pub candidates: [[u32; 4]; 8],
    pub opaque_boxes: u32,
}

impl Report {
    /// The candidates in an order that does not depend on the tree.
    pub fn sorted_candidates(&self) -> Vec<[u32; 4]> {
        let mut all = self.candidates[..self.candidates.len().min(self.candidate_count as usize)].to_vec();
        all.sort_unstable();
        all
    }
}

/// What a ray meets by the header for kd-trees, and by a query of a BVH in the same shader.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct KdReport {
    pub of_kd_tree: Hit,
    pub of_query: Hit,
    pub is_hit: u32,
    /// Index, first primitive and flags of the geometry that is hit.
    pub geometry: [u32; 3],
}

#[derive(Clone, Copy, bytemuck::NoUninit)]
#[repr(C)]
struct KdPush {
    kd_tree: u64,
    bvh: u64,
    rays: u64,
    reports: u64,
    count: u32,
    padding: u32,
}

#[derive(Clone, Copy, bytemuck::NoUninit)]
#[repr(C)]
struct Push {
    structure: u64,
    rays: u64,
    reports: u64,
    count: u32,
    padding: u32,
}

/// The pipeline; lives as long as the test.
pub struct Probe {
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
}

impl Probe {
    /// For our structures.
    pub fn ours() -> Probe {
        Probe::of(include_bytes!(concat!(env!("OUT_DIR"), "/probe.spv")))
    }

    /// For the driver's.
    pub fn of_the_driver() -> Probe {
        Probe::of(include_bytes!(concat!(env!("OUT_DIR"), "/probe_of_the_driver.spv")))
    }

    /// For kd-trees.
    pub fn of_kd_trees() -> Probe {
        Probe::of(include_bytes!(concat!(env!("OUT_DIR"), "/kd_probe.spv")))
    }

    fn of(spirv: &[u8]) -> Probe {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(spirv)).expect("SPIR-V");
        let raw = device().ash_device();
        let range = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(size_of::<KdPush>().max(size_of::<Push>()) as u32)];
        unsafe {
            let layout = raw
                .create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&range), None)
                .expect("a layout");
            let module =
                raw.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None).expect("a module");
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
            let pipeline =
                raw.create_compute_pipelines(vk::PipelineCache::null(), &[info], None).expect("a pipeline")[0];
            raw.destroy_shader_module(module, None);
            Probe { layout, pipeline }
        }
    }

    /// Asks of every ray.
    pub fn ask(&self, structure: u64, rays: &[ProbeRay]) -> Vec<Report> {
        let ray_buffer = device().upload("rays", rays).expect("memory");
        let reports = device().buffer("reports", (size_of::<Report>() * rays.len()) as u64);
        let reports = reports.expect("memory");
        let push = Push {
            structure,
            rays: ray_buffer.address(),
            reports: reports.address(),
            count: rays.len() as u32,
            padding: 0,
        };
        self.dispatch(bytemuck::bytes_of(&push), push.count);
        reports.read(rays.len())
    }

    /// Traces every ray through both.
    pub fn ask_kd_tree(&self, kd_tree: u64, bvh: u64, rays: &[Ray]) -> Vec<KdReport> {
        let ray_buffer = device().upload("rays", rays).expect("memory");
        let reports = device().buffer("reports", size_of::<KdReport>() as u64 * rays.len() as u64).expect("memory");
        let push = KdPush {
            kd_tree,
            bvh,
            rays: ray_buffer.address(),
            reports: reports.address(),
            count: rays.len() as u32,
            padding: 0,
        };
        self.dispatch(bytemuck::bytes_of(&push), push.count);
        reports.read(rays.len())
    }

    fn dispatch(&self, push: &[u8], count: u32) {
        let record = |recorder: &mut Recorder<'_>| {
            let (raw, commands) = (device().ash_device(), recorder.commands());
            unsafe {
                raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, self.pipeline);
                raw.cmd_push_constants(commands, self.layout, vk::ShaderStageFlags::COMPUTE, 0, push);
                raw.cmd_dispatch(commands, count.div_ceil(64), 1, 1);
            }
            Ok(())
        };
        device().run(None, record).expect("it traces");
    }
}

impl Drop for Probe {
    fn drop(&mut self) {
        unsafe {
            device().ash_device().destroy_pipeline(self.pipeline, None);
            device().ash_device().destroy_pipeline_layout(self.layout, None);
        }
    }
}
