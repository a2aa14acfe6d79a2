//! Acceleration structures by the calls of `VK_KHR_acceleration_structure`: ours or the driver's, and nothing else differs.

use super::device_rays::{RayBuffers, timed_run};
use super::queries::{self, Forms, Queried, Queries, QueryWork};
use crate::device::{Buffer, Device, DriverRays, DriverTracing};
use crate::experiments::accel::points;
use crate::scene::Mesh;
use crate::{Error, Result};
use ash::khr::acceleration_structure as functions;
use ash::vk;
use hedgerow::accel;
use hedgerow::gpu::{Recorder, Timestamps};
use hedgerow::trace::Query;
use hedgerow::trace::tracer::TraceBuffers;
use std::cell::Cell;
use std::rc::Rc;

/// What a build call takes.
pub type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
/// How many primitives of a geometry, and where they begin.
pub type Range = vk::AccelerationStructureBuildRangeInfoKHR;
/// A handle.
pub type Structure = vk::AccelerationStructureKHR;
/// What is built over.
pub type Geometry = vk::AccelerationStructureGeometryKHR<'static>;
/// Bytes that a structure and its builds need.
pub type BuildSizes = vk::AccelerationStructureBuildSizesInfoKHR<'static>;

/// The functions that build.
#[derive(Clone)]
enum Functions<'a> {
    Ours(accel::Device<'a>),
    Driver(functions::Device),
}

/// Structures of one maker.
#[derive(Clone)]
pub struct Structures<'a> {
    pub(crate) device: &'a Device,
    maker: Functions<'a>,
    /// Nodes of those that were asked for, if they are ours.
    forms: Rc<Cell<Forms>>,
}

impl<'a> Structures<'a> {
    /// Ours.
    pub fn ours(device: &'a Device, options: accel::AccelOptions) -> Structures<'a> {
        Structures::of(device, accel::Device::with_options(device, options))
    }

    /// Ours, by the calls of `ours`.
    pub fn of(device: &'a Device, ours: accel::Device<'a>) -> Structures<'a> {
        Structures { device, maker: Functions::Ours(ours), forms: Rc::default() }
    }

    /// The same, with arguments of builds in a part of `memory`, if they are ours.
    pub(crate) fn with_arguments_in(&self, memory: &Buffer<'_>) -> Option<Structures<'a>> {
        let Functions::Ours(ours) = &self.maker else { return None };
        let part = hedgerow::gpu::ArgumentMemory { buffer: memory.raw(), offset: 0, bytes: memory.bytes() };
        // SAFETY: buffers of `Device` have the usage; who keeps the structures keeps the memory.
        let ours = unsafe { ours.with_arguments_in(part) };
        Some(Structures { maker: Functions::Ours(ours), ..self.clone() })
    }

    /// The same, traced by a shader for structures of these nodes.
    pub(crate) fn traced_as(&self, forms: Forms) -> Structures<'a> {
        Structures { forms: Rc::new(Cell::new(forms)), ..self.clone() }
    }

    /// Those of the driver, where it has any and the device was opened with them.
    pub fn drivers(device: &'a Device) -> Option<Structures<'a>> {
        device.driver_tracing()?;
        let functions = functions::Device::new(device.ash_instance(), device.ash_device());
        Some(Structures { device, maker: Functions::Driver(functions), forms: Rc::default() })
    }

    /// Whose they are.
    pub fn maker(&self) -> points::Implementation {
        match self.maker {
            Functions::Ours(_) => points::Implementation::Ours,
            Functions::Driver(_) => points::Implementation::Driver,
        }
    }

    /// Bytes that a build of this many primitives a geometry needs.
    pub(crate) fn sizes(&self, info: &BuildInfo<'_>, counts: &[u32]) -> Result<BuildSizes> {
        let mut sizes = BuildSizes::default();
        let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        match &self.maker {
            // SAFETY: the pointers of `info` are those of live slices.
            Functions::Ours(ours) => unsafe {
                ours.get_acceleration_structure_build_sizes(place, info, counts, &mut sizes)?;
                self.forms.set(self.forms.get().with(ours.makes_nodes_of_eight(info, counts)?));
            },
            // SAFETY: as above.
            Functions::Driver(driver) => unsafe {
                driver.get_acceleration_structure_build_sizes(place, info, counts, &mut sizes)
            },
        }
        Ok(sizes)
    }

    /// A structure in the place that `info` names.
    pub(crate) fn create(&self, info: &vk::AccelerationStructureCreateInfoKHR<'_>) -> Result<Structure> {
        match &self.maker {
            // SAFETY: the buffer is live and as large as the sizes asked for.
            Functions::Ours(ours) => Ok(unsafe { ours.create_acceleration_structure(info, None) }?),
            // SAFETY: as above.
            Functions::Driver(driver) => unsafe { driver.create_acceleration_structure(info, None) }
                .map_err(Error::vulkan("vkCreateAccelerationStructureKHR")),
        }
    }

    /// What instances and shaders take.
    pub(crate) fn address(&self, structure: Structure) -> u64 {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(structure);
        match &self.maker {
            Functions::Ours(ours) => ours.get_acceleration_structure_device_address(&info),
            // SAFETY: the structure is live.
            Functions::Driver(driver) => unsafe { driver.get_acceleration_structure_device_address(&info) },
        }
    }

    /// Ends the life of a structure that no submit uses any more.
    pub(crate) fn destroy(&self, structure: Structure) {
        match &self.maker {
            Functions::Ours(ours) => ours.destroy_acceleration_structure(structure, None),
            // SAFETY: every submit of `Device` waits, so nothing uses it.
            Functions::Driver(driver) => unsafe { driver.destroy_acceleration_structure(structure, None) },
        }
    }

    /// Records builds; rays and builds behind it may use them.
    pub(crate) fn build(
        &self,
        recorder: &mut Recorder<'_>,
        infos: &[BuildInfo<'_>],
        ranges: &[&[Range]],
    ) -> hedgerow::Result<()> {
        match &self.maker {
            Functions::Ours(ours) => {
                // SAFETY: all memory is live until the submit has finished, and each build's own.
                unsafe { ours.cmd_build_acceleration_structures(recorder.commands(), infos, ranges) }?;
                recorder.barrier();
            }
            Functions::Driver(driver) => {
                let access = vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR
                    | vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
                let barrier = vk::MemoryBarrier::default().src_access_mask(access).dst_access_mask(access);
                let build = vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;
                let trace =
                    self.device.driver_tracing().map_or(vk::PipelineStageFlags::COMPUTE_SHADER, DriverTracing::stage);
                let (raw, commands) = (self.device.ash_device(), recorder.commands());
                let none = vk::DependencyFlags::empty();
                // SAFETY: as above.
                unsafe {
                    driver.cmd_build_acceleration_structures(commands, infos, ranges);
                    raw.cmd_pipeline_barrier(commands, build, build | trace, none, &[barrier], &[], &[]);
                }
            }
        }
        Ok(())
    }

    /// Bytes of a compacted copy of a structure of ours.
    ///
    /// # Errors
    /// It is the driver's; too little memory; the device failed.
    pub(crate) fn compacted_bytes(&self, structure: Structure) -> Result<u64> {
        let Functions::Ours(ours) = &self.maker else {
            return Err(Error::Argument("the driver's structures are not asked for properties".into()));
        };
        let result = self.device.buffer("property", size_of::<u64>() as u64)?;
        self.device.run(None, |recorder| {
            let (commands, property) = (recorder.commands(), accel::Property::CompactedSize);
            // SAFETY: the structure and the buffer are live until the submit has finished.
            unsafe {
                ours.cmd_write_acceleration_structures_properties(commands, &[structure], property, result.address())
            }
        })?;
        Ok(result.read::<u64>(1)[0])
    }

    /// Traces rays that lie in device memory through a top level; milliseconds by the device's timestamps.
    pub(crate) fn trace(
        &self,
        timestamps: &mut Timestamps,
        top: Structure,
        buffers: &RayBuffers<'_>,
        query: Query,
        queries: Queries,
    ) -> Result<f64> {
        let buffers = buffers.buffers(self.address(top), None);
        timed_run(self.device, timestamps, "trace", |recorder| self.record_trace(recorder, &buffers, query, queries))
    }

    /// Records the tracing of rays through a top level; their work, where there is room for it, is counted for ours alone, and
    /// theirs are one each in any case.
    pub(crate) fn record_trace(
        &self,
        recorder: &mut Recorder<'_>,
        buffers: &TraceBuffers,
        query: Query,
        queries: Queries,
    ) -> hedgerow::Result<()> {
        match self.maker {
            Functions::Ours(_) => {
                let queried = Queried { one_level: false, forms: self.forms.get() };
                queries::record(recorder, query, buffers, queried, queries)
            }
            Functions::Driver(_) => {
                let any_hit = query == Query::AnyHit;
                let &TraceBuffers { structure, rays, hits, count, .. } = buffers;
                let rays = DriverRays { structure, rays: rays.address, hits: hits.address, count, any_hit };
                self.device.trace_by_driver(recorder, &rays)
            }
        }
    }

    /// What each of the rays meets on its way, of our structures: nodes of the top level, instances, nodes below, triangles.
    pub(crate) fn work(&self, top: Structure, buffers: &RayBuffers<'_>, query: Query) -> Result<Vec<QueryWork>> {
        if let Functions::Driver(_) = self.maker {
            return Err(Error::Argument("the driver does not report the work of its queries".into()));
        }
        let works = self.device.buffer("work", 16 * u64::from(buffers.count))?;
        let traced = buffers.buffers(self.address(top), Some(works.region()));
        self.device.run(None, |recorder| self.record_trace(recorder, &traced, query, Queries::OneEach))?;
        Ok(works.read(buffers.count as usize))
    }
}

/// An address of what a build reads.
pub(crate) fn address(device_address: u64) -> vk::DeviceOrHostAddressConstKHR {
    vk::DeviceOrHostAddressConstKHR { device_address }
}

/// Vulkan's struct for instances, or pointers to them.
pub fn instances_at(at: u64, by_pointers: bool) -> Geometry {
    let instances =
        vk::AccelerationStructureGeometryInstancesDataKHR::default().array_of_pointers(by_pointers).data(address(at));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances })
}

/// Opaque triangles of a mesh whose positions and indices lie in these buffers.
pub(crate) fn triangles_of(mesh: &Mesh, positions: &Buffer<'_>, indices: &Buffer<'_>) -> Geometry {
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk::Format::R32G32B32_SFLOAT)
        .vertex_data(address(positions.address()))
        .vertex_stride(12)
        .max_vertex(mesh.positions.len().saturating_sub(1) as u32)
        .index_type(vk::IndexType::UINT32)
        .index_data(address(indices.address()));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        .flags(vk::GeometryFlagsKHR::OPAQUE)
}
