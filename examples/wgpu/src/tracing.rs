//! The engine's own compute pipeline, on the device that wgpu owns.

use crate::Result;
use crate::scene::Camera;
use hedgerow::ash::{self, vk};

static SHADER: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/trace.spv"));
/// The shader's `local_size_x`.
const WORKGROUP: u32 = 64;

/// The push constants of `trace.comp`.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Push {
    pub scene: u64,
    pub positions: u64,
    pub triangles: u64,
    pub picture: u64,
    pub size: [u32; 2],
    pub camera: Camera,
}

pub struct Tracing {
    device: ash::Device,
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
}

impl Tracing {
    pub fn new(device: &ash::Device) -> Result<Tracing> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(SHADER))?;
        let bytes = size_of::<Push>() as u32;
        let range = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(bytes)];
        // SAFETY: the device lives; the module is needed until the pipeline is made.
        unsafe {
            let layout = device
                .create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&range), None)?;
            let module = device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
            let made = device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            device.destroy_shader_module(module, None);
            let pipeline = made.map_err(|(_, error)| error)?[0];
            Ok(Tracing { device: device.clone(), pipeline, layout })
        }
    }

    /// Records the rays of a picture.
    ///
    /// # Safety
    /// `commands` is being recorded; the addresses stay valid until it has run.
    pub unsafe fn record(&self, commands: vk::CommandBuffer, push: &Push) {
        let stage = vk::ShaderStageFlags::COMPUTE;
        // SAFETY: the caller's promise; pipeline and layout live as long as this.
        unsafe {
            self.device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, self.pipeline);
            self.device.cmd_push_constants(commands, self.layout, stage, 0, bytemuck::bytes_of(push));
            self.device.cmd_dispatch(commands, (push.size[0] * push.size[1]).div_ceil(WORKGROUP), 1, 1);
        }
    }
}

impl Drop for Tracing {
    fn drop(&mut self) {
        // SAFETY: made here; the engine has waited for the queue, and drops this before wgpu's device.
        unsafe {
            self.device.destroy_pipeline(self.pipeline, None);
            self.device.destroy_pipeline_layout(self.layout, None);
        }
    }
}
