//! A small engine that links hedgerow: instance, device, allocator, memory, command buffer and shader are all its own.
//!
//! It asks the library what a device must have, makes a device with exactly that, records the builds of two bottom-level
//! structures and of a top level over instances of them (by the calls and structs of `VK_KHR_acceleration_structure`, which the
//! device need not have) and the dispatch of its own shader (`engine.comp`, written for `GLSL_EXT_ray_query`, which the device
//! need not have either) into one command buffer, submits that once, and writes what the shader drew.
//!
//! ```text
//! cargo run --release --example engine --no-default-features --features compile-shaders -- picture.png
//! ```

use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use hedgerow::accel::{self, Instance};
use hedgerow::ash::{self, vk};
use hedgerow::gpu::{Context, ContextDesc, Optional, Requirements, requirements};
use std::error::Error;
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

pub const WIDTH: u32 = 320;
pub const HEIGHT: u32 = 240;
pub const EYE: [f32; 3] = [3.0, 3.5, 5.5];
pub const LAMP: [f32; 3] = [-4.0, 7.0, 3.0];
const WORKGROUP: u32 = 64;
static SHADER: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/example_engine.spv"));

/// The push constants of `engine.comp`.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Push {
    scene: u64,
    positions: u64,
    triangles: u64,
    picture: u64,
    size: [u32; 2],
    eye: [f32; 3],
    lamp: [f32; 3],
}

#[allow(dead_code, reason = "the test that includes this file calls draw")]
fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "engine.png".into());
    draw(path.as_ref())?;
    println!("{path}");
    Ok(())
}

/// Draws knots above a floor into a PNG of [`WIDTH`] × [`HEIGHT`] pixels.
pub fn draw(path: &Path) -> Result<()> {
    let mut engine = Engine::new()?;
    let pixels = engine.render(&Model::knot_and_floor())?;
    let image = image::RgbaImage::from_raw(WIDTH, HEIGHT, pixels).ok_or("the picture has another size")?;
    Ok(image.save(path)?)
}

/// Triangles of two parts over common vertices.
pub struct Model {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    /// Of the floor, and of the knot.
    pub parts: [std::ops::Range<u32>; 2],
}

/// Object to world, row by row.
pub type Transform = [[f32; 4]; 3];

/// Which part stands where: the floor, a knot, and a small one on its side.
pub const PLACES: [(usize, Transform); 3] = [
    (0, Instance::IDENTITY),
    (1, Instance::IDENTITY),
    (1, [[0.0, -0.35, 0.0, 2.2], [0.35, 0.0, 0.0, -0.3], [0.0, 0.0, 0.35, 1.6]]),
];

/// Three floats a vertex, three 32-bit indices a triangle.
fn opaque_triangles(
    positions: &Buffer,
    vertices: u32,
    triangles: &Buffer,
) -> vk::AccelerationStructureGeometryKHR<'static> {
    let address = |buffer: &Buffer| vk::DeviceOrHostAddressConstKHR { device_address: buffer.address };
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk::Format::R32G32B32_SFLOAT)
        .vertex_data(address(positions))
        .vertex_stride(12)
        .max_vertex(vertices - 1)
        .index_type(vk::IndexType::UINT32)
        .index_data(address(triangles));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        .flags(vk::GeometryFlagsKHR::OPAQUE)
}

fn instances_at(address: u64) -> vk::AccelerationStructureGeometryKHR<'static> {
    let data = vk::DeviceOrHostAddressConstKHR { device_address: address };
    let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(data);
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances })
}

/// What is built of geometries, without its memory.
fn build_info<'a>(
    ty: vk::AccelerationStructureTypeKHR,
    geometries: &'a [vk::AccelerationStructureGeometryKHR<'a>],
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(ty)
        .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
        .geometries(geometries)
}

/// A structure with its memory.
struct Structure {
    raw: vk::AccelerationStructureKHR,
    address: u64,
    memory: Buffer,
    scratch: Buffer,
}

impl Structure {
    /// `info` with the structure's memory, ready to be built.
    fn placed<'a>(
        &self,
        info: vk::AccelerationStructureBuildGeometryInfoKHR<'a>,
    ) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
        info.dst_acceleration_structure(self.raw)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: self.scratch.address })
    }
}

/// What every engine has anyway.
struct Engine {
    // Dropped first: it returns its memory to the device.
    allocator: Option<Allocator>,
    device: ash::Device,
    /// What the device was made with of what is optional.
    optional: Optional,
    physical: vk::PhysicalDevice,
    instance: ash::Instance,
    queue_family: u32,
    _entry: ash::Entry,
}

impl Engine {
    fn new() -> Result<Engine> {
        // SAFETY: as every Vulkan program: the loader is loaded, and each handle is used while what it came from lives.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None)?;
            let (physical, needs) = pick(&instance)?;

            // The device has what the library requires, and what makes it faster where there is that.
            let Requirements { queue_family, extensions, mut features, optional, .. } = needs;
            let queue =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
            let extensions: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queue).enabled_extension_names(&extensions);
            let device = instance.create_device(physical, &features.push_into(info), None)?;
            let allocator = Allocator::new(&AllocatorCreateDesc {
                instance: instance.clone(),
                device: device.clone(),
                physical_device: physical,
                debug_settings: Default::default(),
                buffer_device_address: true,
                allocation_sizes: Default::default(),
            })?;
            Ok(Engine { allocator: Some(allocator), device, optional, physical, instance, queue_family, _entry: entry })
        }
    }

    fn render(&mut self, model: &Model) -> Result<Vec<u8>> {
        let desc = ContextDesc::new(&self.instance, self.physical, &self.device, self.optional);
        // SAFETY: the device was made from these with what `requirements` returned, and outlives the context.
        let context = unsafe { Context::new(&desc) }?;

        // 1. The engine brings data and memory; the structs are Vulkan's own.
        let structures = accel::Device::new(&context);
        let positions = self.filled("positions", bytemuck::cast_slice(&model.positions))?;
        let triangles = self.filled("triangles", bytemuck::cast_slice(&model.triangles))?;
        let geometry = [opaque_triangles(&positions, model.positions.len() as u32, &triangles)];
        let bottom = build_info(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, &geometry);
        let ranges = model.parts.each_ref().map(|part| {
            [vk::AccelerationStructureBuildRangeInfoKHR::default()
                .primitive_count(part.len() as u32)
                .primitive_offset(12 * part.start)]
        });
        let floor = self.structure(&structures, &bottom, model.parts[0].len() as u32)?;
        let knot = self.structure(&structures, &bottom, model.parts[1].len() as u32)?;
        let places = PLACES.map(|(part, transform)| {
            let structure = [&floor, &knot][part].address;
            Instance::new(structure, transform).with_index_and_mask(model.parts[part].start, 0xff)
        });
        let instances = self.filled("instances", bytemuck::cast_slice(&places))?;
        let instance_geometry = [instances_at(instances.address)];
        let top = build_info(vk::AccelerationStructureTypeKHR::TOP_LEVEL, &instance_geometry);
        let all = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(PLACES.len() as u32)];
        let scene = self.structure(&structures, &top, PLACES.len() as u32)?;
        let picture = self.buffer("picture", u64::from(4 * WIDTH * HEIGHT))?;

        let push = Push {
            scene: scene.address,
            positions: positions.address,
            triangles: triangles.address,
            picture: picture.address,
            size: [WIDTH, HEIGHT],
            eye: EYE,
            lamp: LAMP,
        };
        let pipeline = self.pipeline(size_of::<Push>() as u32)?;
        self.submit(|device, commands| {
            // 2. The library records the builds, the engine what it does with them.
            // SAFETY: the command buffer records, on a queue of the family that `requirements` named; all memory lives until
            // the queue has finished.
            unsafe {
                let parts = [floor.placed(bottom), knot.placed(bottom)];
                structures.cmd_build_acceleration_structures(commands, &parts, &[&ranges[0], &ranges[1]])?;
                built(device, commands);
                structures.cmd_build_acceleration_structures(commands, &[scene.placed(top)], &[&all])?;
                built(device, commands);
            }
            // SAFETY: pipeline, layout and buffers live until the queue has finished.
            unsafe {
                device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline.pipeline);
                let stage = vk::ShaderStageFlags::COMPUTE;
                device.cmd_push_constants(commands, pipeline.layout, stage, 0, bytemuck::bytes_of(&push));
                device.cmd_dispatch(commands, (WIDTH * HEIGHT).div_ceil(WORKGROUP), 1, 1);
            }
            Ok(())
        })?;
        let pixels = picture.bytes()?.to_vec();

        // SAFETY: the queue has finished; nothing uses these any more.
        unsafe {
            self.device.destroy_pipeline(pipeline.pipeline, None);
            self.device.destroy_pipeline_layout(pipeline.layout, None);
        }
        let memory = [floor, knot, scene].into_iter().flat_map(|structure| {
            structures.destroy_acceleration_structure(structure.raw, None);
            [structure.memory, structure.scratch]
        });
        for buffer in memory.collect::<Vec<_>>().into_iter().chain([positions, triangles, instances, picture]) {
            // SAFETY: as above.
            unsafe { self.device.destroy_buffer(buffer.raw, None) };
            self.allocator.as_mut().ok_or("the allocator is gone")?.free(buffer.allocation)?;
        }
        Ok(pixels)
    }

    /// Asks how much memory the build of `info` over `count` primitives needs, and brings it.
    fn structure(
        &mut self,
        structures: &accel::Device<'_>,
        info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        count: u32,
    ) -> Result<Structure> {
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: the geometry lives.
        unsafe { structures.get_acceleration_structure_build_sizes(place, info, &[count], &mut sizes) }?;
        let memory = self.buffer("structure", sizes.acceleration_structure_size)?;
        let scratch = self.buffer("scratch", sizes.build_scratch_size)?;
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(memory.raw)
            .size(sizes.acceleration_structure_size)
            .ty(info.ty);
        // SAFETY: the buffer lives and has so many bytes.
        let raw = unsafe { structures.create_acceleration_structure(&create, None) }?;
        let address = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(raw);
        let address = structures.get_acceleration_structure_device_address(&address);
        Ok(Structure { raw, address, memory, scratch })
    }

    /// Memory that holds `bytes`.
    fn filled(&mut self, name: &str, bytes: &[u8]) -> Result<Buffer> {
        let mut buffer = self.buffer(name, bytes.len() as u64)?;
        buffer.write(bytes)?;
        Ok(buffer)
    }

    /// Memory that the host maps and shaders reach by its address.
    fn buffer(&mut self, name: &str, bytes: u64) -> Result<Buffer> {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
        // SAFETY: the device lives; the buffer is bound before it is used.
        unsafe {
            let raw = self.device.create_buffer(&vk::BufferCreateInfo::default().size(bytes).usage(usage), None)?;
            let allocation =
                self.allocator.as_mut().ok_or("the allocator is gone")?.allocate(&AllocationCreateDesc {
                    name,
                    requirements: self.device.get_buffer_memory_requirements(raw),
                    location: MemoryLocation::CpuToGpu,
                    linear: true,
                    allocation_scheme: AllocationScheme::GpuAllocatorManaged,
                })?;
            self.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset())?;
            let address = self.device.get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(raw));
            Ok(Buffer { raw, allocation, address })
        }
    }

    fn pipeline(&self, push_bytes: u32) -> Result<Pipeline> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(SHADER))?;
        let range = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(push_bytes)];
        // SAFETY: the device lives; the module is needed until the pipeline is made.
        unsafe {
            let layout = self
                .device
                .create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&range), None)?;
            let module = self.device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
            let made = self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            self.device.destroy_shader_module(module, None);
            let pipeline = made.map_err(|(_, error)| error)?[0];
            Ok(Pipeline { pipeline, layout })
        }
    }

    /// Records, submits and waits.
    fn submit(&self, record: impl FnOnce(&ash::Device, vk::CommandBuffer) -> Result<()>) -> Result<()> {
        let device = &self.device;
        // SAFETY: pool and fence are made here and destroyed when the queue has finished.
        unsafe {
            let pool_info = vk::CommandPoolCreateInfo::default().queue_family_index(self.queue_family);
            let pool = device.create_command_pool(&pool_info, None)?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let commands = device.allocate_command_buffers(&info)?;
            device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default())?;
            record(device, commands[0])?;
            let to_host = [vk::MemoryBarrier::default()
                .src_access_mask(vk::AccessFlags::SHADER_WRITE)
                .dst_access_mask(vk::AccessFlags::HOST_READ)];
            let (shader, host) = (vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::HOST);
            device.cmd_pipeline_barrier(commands[0], shader, host, vk::DependencyFlags::empty(), &to_host, &[], &[]);
            device.end_command_buffer(commands[0])?;
            let fence = device.create_fence(&vk::FenceCreateInfo::default(), None)?;
            let queue = device.get_device_queue(self.queue_family, 0);
            device.queue_submit(queue, &[vk::SubmitInfo::default().command_buffers(&commands)], fence)?;
            device.wait_for_fences(&[fence], true, 60_000_000_000)?;
            device.destroy_fence(fence, None);
            device.destroy_command_pool(pool, None);
        }
        Ok(())
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        drop(self.allocator.take());
        // SAFETY: everything made from them is gone.
        unsafe {
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

/// What builds have written, later builds and shaders read.
///
/// # Safety
/// `commands` is being recorded.
unsafe fn built(device: &ash::Device, commands: vk::CommandBuffer) {
    let written = [vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::SHADER_WRITE)
        .dst_access_mask(vk::AccessFlags::SHADER_READ)];
    let shader = vk::PipelineStageFlags::COMPUTE_SHADER;
    // SAFETY: the caller's promise.
    unsafe {
        device.cmd_pipeline_barrier(commands, shader, shader, vk::DependencyFlags::empty(), &written, &[], &[]);
    }
}

struct Pipeline {
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
}

struct Buffer {
    raw: vk::Buffer,
    allocation: Allocation,
    address: u64,
}

impl Buffer {
    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let mapped = self.allocation.mapped_slice_mut().ok_or("the memory is not mapped")?;
        mapped[..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }

    fn bytes(&self) -> Result<&[u8]> {
        let mapped = self.allocation.mapped_slice().ok_or("the memory is not mapped")?;
        Ok(&mapped[..(4 * WIDTH * HEIGHT) as usize])
    }
}

/// The first device that has what the library requires.
fn pick(instance: &ash::Instance) -> Result<(vk::PhysicalDevice, Requirements)> {
    // SAFETY: the instance lives.
    let devices = unsafe { instance.enumerate_physical_devices() }?;
    let mut lacking = Vec::new();
    for physical in devices {
        match requirements(instance, physical) {
            Ok(needs) => return Ok((physical, needs)),
            Err(error) => lacking.push(error.to_string()),
        }
    }
    Err(format!("no device can be used: {}", lacking.join("; ")).into())
}

impl Model {
    /// A square, and a torus knot of about 9,000 triangles.
    pub fn knot_and_floor() -> Model {
        const AROUND: u32 = 320;
        const ACROSS: u32 = 14;
        const TURN: f32 = std::f32::consts::TAU;
        let centre = |s: f32| {
            let ring = 1.2 + 0.5 * (3.0 * s).cos();
            [ring * (2.0 * s).cos(), 0.6 * (3.0 * s).sin(), ring * (2.0 * s).sin()]
        };
        let mut positions = vec![[-8.0, -1.2, -8.0], [8.0, -1.2, -8.0], [8.0, -1.2, 8.0], [-8.0, -1.2, 8.0]];
        let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
        for i in 0..AROUND {
            let s = i as f32 / AROUND as f32 * TURN;
            let [from, to] = [centre(s), centre(s + 0.01)];
            let along = unit(std::array::from_fn(|k| to[k] - from[k]));
            let side = unit(cross(along, [0.0, 1.0, 0.0]));
            let up = cross(side, along);
            for j in 0..ACROSS {
                let (sin, cos) = (j as f32 / ACROSS as f32 * TURN).sin_cos();
                positions.push(std::array::from_fn(|k| from[k] + 0.22 * (cos * side[k] + sin * up[k])));
                let corner = |i: u32, j: u32| 4 + i % AROUND * ACROSS + j % ACROSS;
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let parts = [0..2, 2..triangles.len() as u32];
        Model { positions, triangles, parts }
    }
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = a.iter().map(|x| x * x).sum::<f32>().sqrt();
    a.map(|x| x / length)
}
