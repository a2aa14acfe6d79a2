//! The driver's acceleration structures and ours behind the same calls, so that one table of cases runs through both.

use super::device;
use super::geometries::Owned;
use super::probe::{self, Probe, ProbeRay, ProbeReport};
use hedgerow::ash::{self, vk};
use hedgerow::bvh::geometry::{Geometry, IndexFormat, VertexFormat};
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::device::{DriverRays, DriverTracing};
pub use hedgerow_lab::experiments::check::backend::{Backend, BuildInfo, Built, Ours, Ranges};
use hedgerow_lab::subjects::structures::Structures;

/// Ours, and the driver's where the device has it with ray queries, which shaders of engines ask.
pub fn backends() -> Vec<Box<dyn Traces>> {
    let mut all: Vec<Box<dyn Traces>> = vec![Box::new(Ours::on(device()))];
    if device().driver_tracing() == Some(DriverTracing::Query) {
        all.push(Box::new(Drivers::new()));
    }
    all
}

pub struct Drivers(pub ash::khr::acceleration_structure::Device, Probe, Structures<'static>);

impl Drivers {
    /// For a device that has them.
    pub fn new() -> Drivers {
        let raw = ash::khr::acceleration_structure::Device::new(device().ash_instance(), device().ash_device());
        let structures = Structures::drivers(device()).expect("the driver has structures");
        Drivers(raw, probe::of_the_driver(), structures)
    }
}

impl Backend for Drivers {
    fn structures(&self) -> &Structures<'static> {
        &self.2
    }

    fn scratch_alignment(&self) -> u64 {
        let mut limits = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut limits);
        unsafe { device().ash_instance().get_physical_device_properties2(device().physical_device(), &mut properties) };
        u64::from(limits.min_acceleration_structure_scratch_offset_alignment).max(1)
    }

    fn probe(&self, structure: vk::AccelerationStructureKHR, rays: &[ProbeRay]) -> Vec<ProbeReport> {
        self.1.ask(self.address(structure), rays)
    }
}

/// What traces bottom-level structures.
pub trait Traces: Backend {
    /// The hits of rays in a bottom-level structure.
    fn trace(&self, structure: vk::AccelerationStructureKHR, rays: &[Ray]) -> Vec<Hit>;
}

impl Traces for Ours {
    fn trace(&self, structure: vk::AccelerationStructureKHR, rays: &[Ray]) -> Vec<Hit> {
        let count = rays.len() as u32;
        let ray_buffer = self.device().upload("rays", rays).expect("memory");
        let hits = self.device().buffer("hits", size_of::<Hit>() as u64 * u64::from(count)).expect("memory");
        let structure = self.address(structure);
        let buffers = TraceBuffers { structure, rays: ray_buffer.region(), hits: hits.region(), work: None, count };
        let shape = TraceShape::of(self.device());
        self.device().run(None, |r| tracer::record(r, &shape, Query::ClosestHit, &buffers)).expect("it traces");
        hits.read(rays.len())
    }
}

impl Traces for Drivers {
    /// Through a top level of one instance, which a ray query cannot do without.
    fn trace(&self, structure: vk::AccelerationStructureKHR, rays: &[Ray]) -> Vec<Hit> {
        let reference = self.address(structure);
        let flags = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw();
        let rows = [[1f32, 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]];
        let mut words = [0u32; 16];
        words[..12].copy_from_slice(bytemuck::cast_slice(&rows));
        words[12..].copy_from_slice(&[0xff00_0000, flags << 24, reference as u32, (reference >> 32) as u32]);
        let instances = device().upload("instance", &words).expect("memory");
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: instances.address() });
        let geometry = [vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data })];
        let info = BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL).geometries(&geometry);
        let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(1);
        let top = Built::new(self, &info, &[range], 0);
        let count = rays.len() as u32;
        let ray_buffer = device().upload("rays", rays).expect("memory");
        let hits = device().buffer("hits", size_of::<Hit>() as u64 * u64::from(count)).expect("memory");
        let structure = self.address(top.structure);
        let of_rays = DriverRays { structure, rays: ray_buffer.address(), hits: hits.address(), count, any_hit: false };
        device().run(None, |r| device().trace_by_driver(r, &of_rays)).expect("it traces");
        let hits = hits.read(rays.len());
        self.destroy(top.structure);
        hits
    }
}

/// What an engine calls to copy, each call in a submit of its own.
pub trait Copies: Traces {
    /// What a build must ask for so that its structure can be compacted.
    fn flags_to_compact(&self) -> vk::BuildAccelerationStructureFlagsKHR;
    fn property(&self, structure: vk::AccelerationStructureKHR, query: vk::QueryType) -> u64;
    fn copy(&self, info: &vk::CopyAccelerationStructureInfoKHR<'_>);
    fn serialize(&self, info: &vk::CopyAccelerationStructureToMemoryInfoKHR<'_>);
    fn deserialize(&self, info: &vk::CopyMemoryToAccelerationStructureInfoKHR<'_>);
    fn compatibility(
        &self,
        version: &vk::AccelerationStructureVersionInfoKHR<'_>,
    ) -> vk::AccelerationStructureCompatibilityKHR;
}

impl Copies for Ours {
    fn flags_to_compact(&self) -> vk::BuildAccelerationStructureFlagsKHR {
        vk::BuildAccelerationStructureFlagsKHR::empty()
    }

    fn property(&self, structure: vk::AccelerationStructureKHR, query: vk::QueryType) -> u64 {
        let property = query.try_into().expect("a property of structures");
        let result = device().buffer("property", 16).expect("memory");
        submit(|commands| unsafe {
            self.0.cmd_write_acceleration_structures_properties(commands, &[structure], property, result.address())
        });
        result.read(1)[0]
    }

    fn copy(&self, info: &vk::CopyAccelerationStructureInfoKHR<'_>) {
        submit(|commands| unsafe { self.0.cmd_copy_acceleration_structure(commands, info) });
    }

    fn serialize(&self, info: &vk::CopyAccelerationStructureToMemoryInfoKHR<'_>) {
        submit(|commands| unsafe { self.0.cmd_copy_acceleration_structure_to_memory(commands, info) });
    }

    fn deserialize(&self, info: &vk::CopyMemoryToAccelerationStructureInfoKHR<'_>) {
        submit(|commands| unsafe { self.0.cmd_copy_memory_to_acceleration_structure(commands, info) });
    }

    fn compatibility(
        &self,
        version: &vk::AccelerationStructureVersionInfoKHR<'_>,
    ) -> vk::AccelerationStructureCompatibilityKHR {
        self.0.get_device_acceleration_structure_compatibility(version)
    }
}

impl Copies for Drivers {
    fn flags_to_compact(&self) -> vk::BuildAccelerationStructureFlagsKHR {
        vk::BuildAccelerationStructureFlagsKHR::ALLOW_COMPACTION
    }

    fn property(&self, structure: vk::AccelerationStructureKHR, query: vk::QueryType) -> u64 {
        let info = vk::QueryPoolCreateInfo::default().query_type(query).query_count(1);
        let raw = device().ash_device();
        let mut results = [0u64];
        unsafe {
            let pool = raw.create_query_pool(&info, None).expect("a query pool");
            submit(|commands| {
                raw.cmd_reset_query_pool(commands, pool, 0, 1);
                self.0.cmd_write_acceleration_structures_properties(commands, &[structure], query, pool, 0);
                Ok(())
            });
            let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
            raw.get_query_pool_results(pool, 0, &mut results, flags).expect("a result");
            raw.destroy_query_pool(pool, None);
        }
        results[0]
    }

    fn copy(&self, info: &vk::CopyAccelerationStructureInfoKHR<'_>) {
        submit(|commands| {
            unsafe { self.0.cmd_copy_acceleration_structure(commands, info) };
            Ok(())
        });
    }

    fn serialize(&self, info: &vk::CopyAccelerationStructureToMemoryInfoKHR<'_>) {
        submit(|commands| {
            unsafe { self.0.cmd_copy_acceleration_structure_to_memory(commands, info) };
            Ok(())
        });
    }

    fn deserialize(&self, info: &vk::CopyMemoryToAccelerationStructureInfoKHR<'_>) {
        submit(|commands| {
            unsafe { self.0.cmd_copy_memory_to_acceleration_structure(commands, info) };
            Ok(())
        });
    }

    fn compatibility(
        &self,
        version: &vk::AccelerationStructureVersionInfoKHR<'_>,
    ) -> vk::AccelerationStructureCompatibilityKHR {
        unsafe { self.0.get_device_acceleration_structure_compatibility(version) }
    }
}

fn submit(record: impl FnOnce(vk::CommandBuffer) -> hedgerow::Result<()>) {
    device().run(None, |recorder| record(recorder.commands())).expect("it runs");
}

/// The Vulkan name of a format.
pub fn vk_format(format: VertexFormat) -> vk::Format {
    match format {
        VertexFormat::FLOAT3 => vk::Format::R32G32B32_SFLOAT,
        VertexFormat::FLOAT2 => vk::Format::R32G32_SFLOAT,
        VertexFormat::HALF3 => vk::Format::R16G16B16A16_SFLOAT,
        VertexFormat::HALF2 => vk::Format::R16G16_SFLOAT,
        VertexFormat::SNORM3 => vk::Format::R16G16B16A16_SNORM,
        _ => vk::Format::R16G16_SNORM,
    }
}

/// The Vulkan name of an index format.
pub fn vk_index_type(format: IndexFormat) -> vk::IndexType {
    match format {
        IndexFormat::U8 => vk::IndexType::UINT8_EXT,
        IndexFormat::U16 => vk::IndexType::UINT16,
        IndexFormat::U32 => vk::IndexType::UINT32,
        _ => vk::IndexType::NONE_KHR,
    }
}

/// Vulkan's struct for a geometry on the device.
pub fn vk_geometry(geometry: &Geometry, owned: &Owned) -> vk::AccelerationStructureGeometryKHR<'static> {
    let address = |device_address| vk::DeviceOrHostAddressConstKHR { device_address };
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk_format(owned.vertex_format))
        .vertex_data(address(geometry.vertices))
        .vertex_stride(owned.vertex_stride.into())
        .max_vertex(owned.vertex_count.saturating_sub(1))
        .index_type(vk_index_type(owned.index_format))
        .index_data(address(if owned.index_format == IndexFormat::NONE { 0 } else { geometry.indices }))
        .transform_data(address(geometry.transform));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        .flags(vk::GeometryFlagsKHR::OPAQUE)
}
