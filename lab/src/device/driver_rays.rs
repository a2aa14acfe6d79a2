//! Rays through the driver's own acceleration structures: by a compute shader's ray queries, or by a ray-tracing pipeline with its
//! shader binding table. The hits are the same.

use super::memory::Memory;
use super::{Device, DriverTracing, properties};
use crate::arguments;
use crate::shaders;
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use hedgerow::gpu::shaders::Shader;
use hedgerow::gpu::{Kernel, Recorder};

/// Invocations a workgroup of the kernel that queries.
const WORKGROUP: u32 = 64;

/// Rays to trace through a top level of the driver's.
#[derive(Debug, Clone, Copy)]
pub struct DriverRays {
    /// Address of the top level, as `vkGetAccelerationStructureDeviceAddressKHR` gives it.
    pub structure: u64,
    /// Address of the rays, 32 bytes each.
    pub rays: u64,
    /// Address of the hits, 16 bytes each.
    pub hits: u64,
    /// How many there are.
    pub count: u32,
    /// Whether any hit will do, or the closest is wanted.
    pub any_hit: bool,
}

impl Device {
    /// Records rays through a top level of the driver's, by what the device was opened with.
    ///
    /// # Errors
    /// The device was opened without the driver's structures; a pipeline could not be made.
    pub fn trace_by_driver(&self, recorder: &mut Recorder<'_>, rays: &DriverRays) -> hedgerow::Result<()> {
        let arguments = |first| arguments::TraceQueries {
            structure: rays.structure,
            rays: rays.rays,
            hits: rays.hits,
            works: 0,
            first,
            count: rays.count,
        };
        match self.driver_tracing() {
            None => return Err(super::driver_is_missing(self)),
            Some(DriverTracing::Query) => {
                let kernel = Kernel::new(&shaders::MEASURE_RAY_QUERY, WORKGROUP, &[u32::from(rays.any_hit)]);
                let most = self.limits.workgroup_count.saturating_mul(WORKGROUP);
                for first in (0..rays.count).step_by(most as usize) {
                    let count = (rays.count - first).min(most);
                    recorder.dispatch(&kernel, &arguments(first), count.div_ceil(WORKGROUP))?;
                }
            }
            Some(DriverTracing::Pipeline) => {
                let pipeline = self.ray_pipeline(rays.any_hit)?;
                for first in (0..rays.count).step_by(pipeline.most as usize) {
                    pipeline.record(recorder, &arguments(first), (rays.count - first).min(pipeline.most));
                }
            }
        }
        Ok(())
    }
}

/// A ray-tracing pipeline of a ray-generation, a miss and a closest-hit shader, and its shader binding table.
pub(super) struct RayPipeline {
    functions: ash::khr::ray_tracing_pipeline::Device,
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
    table: Memory,
    /// The regions of the table: ray generation, miss, hit.
    regions: [vk::StridedDeviceAddressRegionKHR; 3],
    /// Rays of a dispatch, at most.
    most: u32,
}

/// The stages, in the order of their groups and of the table's regions.
const STAGES: [(vk::ShaderStageFlags, &Shader); 3] = [
    (vk::ShaderStageFlags::RAYGEN_KHR, &shaders::MEASURE_DRIVER_RAYS),
    (vk::ShaderStageFlags::MISS_KHR, &shaders::MEASURE_DRIVER_MISS),
    (vk::ShaderStageFlags::CLOSEST_HIT_KHR, &shaders::MEASURE_DRIVER_HIT),
];

impl RayPipeline {
    pub fn new(device: &Device, any_hit: bool) -> Result<RayPipeline> {
        let (instance, physical_device) = (device.ash_instance(), device.physical_device());
        let properties: vk::PhysicalDeviceRayTracingPipelinePropertiesKHR<'_> = properties(instance, physical_device);
        // SAFETY: the handles are live.
        let limits = unsafe { instance.get_physical_device_properties(physical_device) }.limits;
        let width =
            u64::from(limits.max_compute_work_group_count[0]) * u64::from(limits.max_compute_work_group_size[0]);
        let most = width.min(properties.max_ray_dispatch_invocation_count.into()).min(1 << 30) as u32;
        let functions = ash::khr::ray_tracing_pipeline::Device::new(instance, &device.raw);
        let range = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::RAYGEN_KHR)
            .size(size_of::<arguments::TraceQueries>() as u32)];
        let info = vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&range);
        // SAFETY: the device is live; `destroy` destroys the layout, or `drop_layout` where a later step fails.
        let layout = unsafe { device.raw.create_pipeline_layout(&info, None) }
            .map_err(Error::vulkan("vkCreatePipelineLayout"))?;
        // SAFETY: ours, and nothing uses it.
        let drop_layout = |_: &Error| unsafe { device.raw.destroy_pipeline_layout(layout, None) };
        let pipeline = pipeline(device, &functions, layout, any_hit).inspect_err(drop_layout)?;
        // SAFETY: as above.
        let drop_pipeline = |_: &Error| unsafe { device.raw.destroy_pipeline(pipeline, None) };
        let table = table(device, &functions, pipeline, &properties);
        let (table, regions) = table.inspect_err(drop_pipeline).inspect_err(drop_layout)?;
        Ok(RayPipeline { functions, layout, pipeline, table, regions, most })
    }

    fn record(&self, recorder: &mut Recorder<'_>, arguments: &arguments::TraceQueries, count: u32) {
        let (commands, device) = (recorder.commands(), recorder.context().ash_device());
        let [generate, miss, hit] = &self.regions;
        // SAFETY: the recorder's promise; pipeline and table live as long as the device.
        unsafe {
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::RAY_TRACING_KHR, self.pipeline);
            let stage = vk::ShaderStageFlags::RAYGEN_KHR;
            device.cmd_push_constants(commands, self.layout, stage, 0, bytemuck::bytes_of(arguments));
            self.functions.cmd_trace_rays(commands, generate, miss, hit, &Default::default(), count, 1, 1);
        }
    }

    pub fn destroy(self, device: &Device) {
        // SAFETY: ours, and no submit uses them any more.
        unsafe {
            device.raw.destroy_pipeline(self.pipeline, None);
            device.raw.destroy_pipeline_layout(self.layout, None);
        }
        device.release(self.table);
    }
}

fn pipeline(
    device: &Device,
    functions: &ash::khr::ray_tracing_pipeline::Device,
    layout: vk::PipelineLayout,
    any_hit: bool,
) -> Result<vk::Pipeline> {
    let any_hit = [u32::from(any_hit)];
    let entry = [vk::SpecializationMapEntry { constant_id: 1, offset: 0, size: 4 }];
    let constants = vk::SpecializationInfo::default().map_entries(&entry).data(bytemuck::cast_slice(&any_hit));
    let mut modules = Vec::new();
    let mut create = || {
        for (_, shader) in STAGES {
            let words =
                ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv)).expect("build.rs wrote whole words");
            let info = vk::ShaderModuleCreateInfo::default().code(&words);
            // SAFETY: the device is live; the modules are destroyed below.
            let module = unsafe { device.raw.create_shader_module(&info, None) };
            modules.push(module.map_err(Error::vulkan("vkCreateShaderModule"))?);
        }
        let stages = [0, 1, 2].map(|i| {
            vk::PipelineShaderStageCreateInfo::default()
                .stage(STAGES[i].0)
                .module(modules[i])
                .name(c"main")
                .specialization_info(&constants)
        });
        let group = vk::RayTracingShaderGroupCreateInfoKHR::default()
            .general_shader(vk::SHADER_UNUSED_KHR)
            .closest_hit_shader(vk::SHADER_UNUSED_KHR)
            .any_hit_shader(vk::SHADER_UNUSED_KHR)
            .intersection_shader(vk::SHADER_UNUSED_KHR);
        let groups = [
            group.ty(vk::RayTracingShaderGroupTypeKHR::GENERAL).general_shader(0),
            group.ty(vk::RayTracingShaderGroupTypeKHR::GENERAL).general_shader(1),
            group.ty(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP).closest_hit_shader(2),
        ];
        let info = vk::RayTracingPipelineCreateInfoKHR::default()
            .stages(&stages)
            .groups(&groups)
            .max_pipeline_ray_recursion_depth(1)
            .layout(layout);
        let none = (vk::DeferredOperationKHR::null(), vk::PipelineCache::null());
        // SAFETY: as above.
        unsafe { functions.create_ray_tracing_pipelines(none.0, none.1, &[info], None) }
            .map(|pipelines| pipelines[0])
            .map_err(|(_, result)| Error::vulkan("vkCreateRayTracingPipelinesKHR")(result))
    };
    let made = create();
    for module in modules {
        // SAFETY: the pipeline needs it no more.
        unsafe { device.raw.destroy_shader_module(module, None) };
    }
    made
}

/// The shader binding table: a record a region, each a handle at the alignment that the device wants.
fn table(
    device: &Device,
    functions: &ash::khr::ray_tracing_pipeline::Device,
    pipeline: vk::Pipeline,
    properties: &vk::PhysicalDeviceRayTracingPipelinePropertiesKHR<'_>,
) -> Result<(Memory, [vk::StridedDeviceAddressRegionKHR; 3])> {
    let handle = properties.shader_group_handle_size as usize;
    let base = u64::from(properties.shader_group_base_alignment);
    let stride = (handle as u64).next_multiple_of(base);
    // SAFETY: the pipeline has three groups.
    let handles = unsafe { functions.get_ray_tracing_shader_group_handles(pipeline, 0, 3, 3 * handle) }
        .map_err(Error::vulkan("vkGetRayTracingShaderGroupHandlesKHR"))?;
    let usage = vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
    let memory = device.memory("driver: shader binding table", 4 * stride, usage, MemoryLocation::CpuToGpu)?;
    let address = device.address_of(&memory);
    let start = address.next_multiple_of(base);
    let mapped = memory.mapped().expect("gpu-allocator maps what is visible to the host");
    for (i, handle) in handles.chunks(handle).enumerate() {
        let at = (start - address + i as u64 * stride) as usize;
        // SAFETY: four records have room, so three have from wherever in the first the table starts.
        unsafe { std::ptr::copy_nonoverlapping(handle.as_ptr(), mapped.add(at), handle.len()) };
    }
    let region =
        |i: u64| vk::StridedDeviceAddressRegionKHR { device_address: start + i * stride, stride, size: stride };
    Ok((memory, [0, 1, 2].map(region)))
}
