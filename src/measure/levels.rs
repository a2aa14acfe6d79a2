//! A scene in two levels: a bottom-level structure for each part, a top level over the instances; ours or the driver's, by the
//! same calls.

use crate::accel::{self, Instance};
use crate::bvh::layout::MAX_DEPTH;
use crate::gpu::{Buffer, Device, Kernel, Recorder, Timestamps, shaders};
use crate::measure::peers::driver::Arguments as Query;
use crate::scene::{Instances, Mesh};
use crate::trace::{self, Hit, Ray};
use crate::{Error, Result};
use ash::vk;

type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;
type Geometry = vk::AccelerationStructureGeometryKHR<'static>;
type Sizes = vk::AccelerationStructureBuildSizesInfoKHR<'static>;

/// Who builds.
#[derive(Clone)]
enum Maker<'a> {
    Ours(accel::Device<'a>),
    Driver(&'a ash::khr::acceleration_structure::Device),
}

/// Structures of one maker.
#[derive(Clone)]
pub struct Structures<'a> {
    device: &'a Device,
    maker: Maker<'a>,
}

impl<'a> Structures<'a> {
    /// Ours.
    pub fn ours(device: &'a Device, options: accel::Options) -> Structures<'a> {
        Structures { device, maker: Maker::Ours(accel::Device::with_options(device, options)) }
    }

    /// Those of the driver, whose functions are these.
    pub fn drivers(device: &'a Device, functions: &'a ash::khr::acceleration_structure::Device) -> Structures<'a> {
        Structures { device, maker: Maker::Driver(functions) }
    }

    fn sizes(&self, info: &BuildInfo<'_>, counts: &[u32]) -> Result<Sizes> {
        let mut sizes = Sizes::default();
        let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        match &self.maker {
            // SAFETY: the pointers of `info` are those of live slices.
            Maker::Ours(ours) => {
                unsafe { ours.get_acceleration_structure_build_sizes(place, info, counts, &mut sizes) }?
            }
            // SAFETY: as above.
            Maker::Driver(driver) => unsafe {
                driver.get_acceleration_structure_build_sizes(place, info, counts, &mut sizes)
            },
        }
        Ok(sizes)
    }

    fn create(&self, info: &vk::AccelerationStructureCreateInfoKHR<'_>) -> Result<vk::AccelerationStructureKHR> {
        match &self.maker {
            // SAFETY: the buffer is live and as large as the sizes asked for.
            Maker::Ours(ours) => unsafe { ours.create_acceleration_structure(info, None) },
            // SAFETY: as above.
            Maker::Driver(driver) => unsafe { driver.create_acceleration_structure(info, None) }
                .map_err(Error::vulkan("vkCreateAccelerationStructureKHR")),
        }
    }

    fn address(&self, structure: vk::AccelerationStructureKHR) -> u64 {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(structure);
        match &self.maker {
            Maker::Ours(ours) => ours.get_acceleration_structure_device_address(&info),
            // SAFETY: the structure is live.
            Maker::Driver(driver) => unsafe { driver.get_acceleration_structure_device_address(&info) },
        }
    }

    /// Records builds; compute shaders and builds behind it may use them.
    fn build(&self, recorder: &mut Recorder<'_>, infos: &[BuildInfo<'_>], ranges: &[&[Range]]) -> Result<()> {
        match &self.maker {
            Maker::Ours(ours) => {
                // SAFETY: all memory is live until the submit has finished, and each build's own.
                unsafe { ours.cmd_build_acceleration_structures(recorder.commands(), infos, ranges) }?;
                recorder.barrier();
            }
            Maker::Driver(driver) => {
                let access = vk::AccessFlags::ACCELERATION_STRUCTURE_READ_KHR
                    | vk::AccessFlags::ACCELERATION_STRUCTURE_WRITE_KHR;
                let barrier = [vk::MemoryBarrier::default().src_access_mask(access).dst_access_mask(access)];
                let build = vk::PipelineStageFlags::ACCELERATION_STRUCTURE_BUILD_KHR;
                let after = build | vk::PipelineStageFlags::COMPUTE_SHADER;
                // SAFETY: as above.
                unsafe {
                    driver.cmd_build_acceleration_structures(recorder.commands(), infos, ranges);
                    recorder.context().ash_device().cmd_pipeline_barrier(
                        recorder.commands(),
                        build,
                        after,
                        vk::DependencyFlags::empty(),
                        &barrier,
                        &[],
                        &[],
                    );
                }
            }
        }
        Ok(())
    }

    /// Memory for a structure and its scratch.
    fn place(&self, name: &str, info: &BuildInfo<'_>, counts: &[u32]) -> Result<Placed<'a>> {
        let sizes = self.sizes(info, counts)?;
        let memory = self.device.buffer(name, sizes.acceleration_structure_size)?;
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(memory.raw())
            .size(sizes.acceleration_structure_size)
            .ty(info.ty);
        let structure = self.create(&create)?;
        // The largest alignment that a driver may ask for.
        let scratch = self.device.buffer("scratch", sizes.build_scratch_size.max(sizes.update_scratch_size) + 256)?;
        Ok(Placed { owner: self.clone(), structure, sizes, scratch, _memory: memory })
    }
}

/// A structure with its memory.
struct Placed<'a> {
    owner: Structures<'a>,
    structure: vk::AccelerationStructureKHR,
    sizes: Sizes,
    scratch: Buffer<'a>,
    _memory: Buffer<'a>,
}

impl Placed<'_> {
    fn scratch(&self) -> vk::DeviceOrHostAddressKHR {
        vk::DeviceOrHostAddressKHR { device_address: self.scratch.address().next_multiple_of(256) }
    }
}

impl Drop for Placed<'_> {
    fn drop(&mut self) {
        if let Maker::Driver(driver) = &self.owner.maker {
            // SAFETY: every submit of `Device` waits, so nothing uses it.
            unsafe { driver.destroy_acceleration_structure(self.structure, None) };
        }
    }
}

fn address(buffer: &Buffer<'_>) -> vk::DeviceOrHostAddressConstKHR {
    vk::DeviceOrHostAddressConstKHR { device_address: buffer.address() }
}

/// Opaque triangles of a mesh whose positions and indices lie in these buffers.
pub(crate) fn triangles_of(mesh: &Mesh, positions: &Buffer<'_>, indices: &Buffer<'_>) -> Geometry {
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk::Format::R32G32B32_SFLOAT)
        .vertex_data(address(positions))
        .vertex_stride(12)
        .max_vertex(mesh.positions.len().saturating_sub(1) as u32)
        .index_type(vk::IndexType::UINT32)
        .index_data(address(indices));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        .flags(vk::GeometryFlagsKHR::OPAQUE)
}

/// A scene's structures.
pub struct Levels<'a> {
    structures: Structures<'a>,
    flags: vk::BuildAccelerationStructureFlagsKHR,
    _parts: Vec<Placed<'a>>,
    instances: Buffer<'a>,
    count: u32,
    top: Placed<'a>,
    geometry: Geometry,
    timestamps: Timestamps,
    /// Bytes of all bottom-level structures.
    pub bottom_bytes: u64,
}

impl<'a> Levels<'a> {
    /// Uploads and builds the parts; the top level has memory and is not built yet. `flags` are those of the top level.
    ///
    /// # Errors
    /// Too little memory; the structs ask for what there is not.
    pub fn new(
        structures: Structures<'a>,
        scene: &Instances,
        flags: vk::BuildAccelerationStructureFlagsKHR,
    ) -> Result<Levels<'a>> {
        let device = structures.device;
        let mut parts = Vec::new();
        for mesh in &scene.parts {
            let positions = device.upload("positions", &mesh.positions)?;
            let indices = device.upload("indices", &mesh.triangles)?;
            let geometry = [triangles_of(mesh, &positions, &indices)];
            let count = mesh.triangles.len() as u32;
            let info = BuildInfo::default()
                .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
                .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
                .geometries(&geometry);
            let placed = structures.place("bottom level", &info, &[count])?;
            let info = info.dst_acceleration_structure(placed.structure).scratch_data(placed.scratch());
            let range = [Range::default().primitive_count(count)];
            device.run(None, |recorder| structures.build(recorder, &[info], &[&range]))?;
            parts.push(placed);
        }
        let placed = |i: &crate::scene::Instance| {
            Instance::new(structures.address(parts[i.part as usize].structure), i.transform)
                .with_offset_and_flags(0, vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE)
        };
        let all: Vec<Instance> = scene.instances.iter().map(placed).collect();
        let instances = device.upload("instances", &all)?;
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(address(&instances));
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        let geometries = [geometry];
        let info =
            BuildInfo::default().ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL).flags(flags).geometries(&geometries);
        let count = all.len() as u32;
        let top = structures.place("top level", &info, &[count])?;
        let timestamps = Timestamps::new(device, 1)?;
        let bottom_bytes = parts.iter().map(|p| p.sizes.acceleration_structure_size).sum();
        Ok(Levels { structures, flags, _parts: parts, instances, count, top, geometry, timestamps, bottom_bytes })
    }

    /// Writes other transforms, for [`Levels::update`] or a build.
    pub fn place(&self, transforms: impl Iterator<Item = [[f32; 4]; 3]>) {
        let mut all: Vec<Instance> = self.instances.read(self.count as usize);
        for (instance, transform) in all.iter_mut().zip(transforms) {
            instance.transform = transform;
        }
        self.instances.write(&all);
    }

    /// Builds the top level; milliseconds by the device's timestamps.
    ///
    /// # Errors
    /// The build cannot be recorded or run.
    pub fn build(&mut self) -> Result<f64> {
        self.record(vk::BuildAccelerationStructureModeKHR::BUILD)
    }

    /// Updates it in place; it was built with `ALLOW_UPDATE`.
    ///
    /// # Errors
    /// As [`Levels::build`].
    pub fn update(&mut self) -> Result<f64> {
        self.record(vk::BuildAccelerationStructureModeKHR::UPDATE)
    }

    fn record(&mut self, mode: vk::BuildAccelerationStructureModeKHR) -> Result<f64> {
        let geometries = [self.geometry];
        let mut info = BuildInfo::default()
            .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
            .flags(self.flags)
            .mode(mode)
            .geometries(&geometries)
            .dst_acceleration_structure(self.top.structure)
            .scratch_data(self.top.scratch());
        if mode == vk::BuildAccelerationStructureModeKHR::UPDATE {
            info = info.src_acceleration_structure(self.top.structure);
        }
        let range = [Range::default().primitive_count(self.count)];
        let structures = &self.structures;
        structures.device.run(Some(&mut self.timestamps), |recorder| {
            recorder.phase("build");
            structures.build(recorder, &[info], &[&range])
        })?;
        Ok(self.timestamps.phases()?.iter().map(|p| p.milliseconds).sum())
    }

    /// Bytes of the top level and of its scratch memory.
    pub fn top_bytes(&self) -> [u64; 2] {
        [self.top.sizes.acceleration_structure_size, self.top.sizes.build_scratch_size]
    }

    /// Traces rays that lie in device memory; milliseconds by the device's timestamps.
    ///
    /// # Errors
    /// The kernel cannot be made or run.
    pub fn trace(&mut self, rays: &Buffer<'_>, hits: &Buffer<'_>, count: u32, query: trace::Query) -> Result<f64> {
        let any_hit = u32::from(query == trace::Query::AnyHit);
        let limits = &self.structures.device.limits;
        let kernel = match self.structures.maker {
            // As trace::tracer has it: on a CPU a subgroup a workgroup, and all of the stack in shared memory.
            Maker::Ours(_) if limits.is_cpu() => {
                Kernel::new(&shaders::MEASURE_QUERY, limits.subgroup_size, &[any_hit, 2 * MAX_DEPTH])
            }
            Maker::Ours(_) => Kernel::new(&shaders::MEASURE_QUERY, 64, &[any_hit, 0]),
            Maker::Driver(_) => Kernel::new(&shaders::MEASURE_RAY_QUERY, 64, &[any_hit]),
        };
        let structure = self.structures.address(self.top.structure);
        let arguments = Query { structure, rays: rays.address(), hits: hits.address(), works: 0, first: 0, count };
        debug_assert!(rays.bytes() >= u64::from(count) * size_of::<Ray>() as u64);
        debug_assert!(hits.bytes() >= u64::from(count) * size_of::<Hit>() as u64);
        self.structures.device.run(Some(&mut self.timestamps), |recorder| {
            recorder.phase("trace");
            recorder.dispatch(&kernel, &arguments, count.div_ceil(kernel.workgroup()))
        })?;
        Ok(self.timestamps.phases()?.iter().map(|p| p.milliseconds).sum())
    }

    /// What each of the rays meets on its way, of our structures: nodes of the top level, instances, nodes below, triangles.
    ///
    /// # Errors
    /// The structures are the driver's; the kernel cannot be made or run.
    pub fn work(
        &mut self,
        rays: &Buffer<'_>,
        hits: &Buffer<'_>,
        count: u32,
        query: trace::Query,
    ) -> Result<Vec<[u32; 4]>> {
        let device = self.structures.device;
        if let Maker::Driver(_) = self.structures.maker {
            return Err(Error::Argument("the driver does not tell the work of its queries".into()));
        }
        let any_hit = u32::from(query == trace::Query::AnyHit);
        let kernel = Kernel::new(&shaders::MEASURE_QUERY_WORK, device.limits.subgroup_size, &[any_hit, 0]);
        let works = device.buffer("work", 16 * u64::from(count))?;
        let structure = self.structures.address(self.top.structure);
        let (rays, hits) = (rays.address(), hits.address());
        let arguments = Query { structure, rays, hits, works: works.address(), first: 0, count };
        device.run(None, |r| r.dispatch(&kernel, &arguments, count.div_ceil(kernel.workgroup())))?;
        Ok(works.read(count as usize))
    }
}
