//! A scene in two levels: a bottom-level structure for each part, a top level over the instances; ours or the driver's, by the
//! same calls.

use super::structures::{BuildInfo, Geometry, Placed, Range, Structures, address, triangles_of};
use crate::Result;
use crate::device::Buffer;
use crate::scene::Instances;
use ash::vk;
use hedgerow::accel::Instance;
use hedgerow::gpu::Timestamps;
use hedgerow::trace;

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

    /// Entries of the top level, where it is one of ours: its instances, those that were opened as their parts.
    pub fn entries(&self) -> Option<u32> {
        self.top.header().map(|header| header.active)
    }

    /// Traces rays that lie in device memory; milliseconds by the device's timestamps.
    ///
    /// # Errors
    /// The kernel cannot be made or run.
    pub fn trace(&mut self, rays: &Buffer<'_>, hits: &Buffer<'_>, count: u32, query: trace::Query) -> Result<f64> {
        self.structures.trace(&mut self.timestamps, self.top.structure, (rays, hits, count), query)
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
        self.structures.work(self.top.structure, (rays, hits, count), query)
    }
}
