//! A mesh whose vertices move, as a bottom-level structure under a top level of one instance.

use crate::Result;
use crate::device::Buffer;
use crate::scene::Mesh;
use crate::subjects::structures::{BuildInfo, Geometry, Placed, Range, Structures, address, triangles_of};
use ash::vk;
use hedgerow::accel::Instance;
use hedgerow::bvh::layout::Header;
use hedgerow::gpu::Timestamps;
use hedgerow::trace::Query;

type Mode = vk::BuildAccelerationStructureModeKHR;
type Flags = vk::BuildAccelerationStructureFlagsKHR;

/// The mesh and its structures.
pub struct Deforming<'a> {
    structures: Structures<'a>,
    positions: Buffer<'a>,
    _indices: Buffer<'a>,
    _instances: Buffer<'a>,
    bottom: Level<'a>,
    top: Level<'a>,
    timestamps: Timestamps,
}

/// A structure, and what it is built over.
struct Level<'a> {
    ty: vk::AccelerationStructureTypeKHR,
    flags: Flags,
    geometry: Geometry,
    count: u32,
    placed: Placed<'a>,
}

impl<'a> Level<'a> {
    fn new(
        structures: &Structures<'a>,
        ty: vk::AccelerationStructureTypeKHR,
        flags: Flags,
        geometry: Geometry,
        count: u32,
    ) -> Result<Level<'a>> {
        let geometries = [geometry];
        let info = BuildInfo::default().ty(ty).flags(flags).geometries(&geometries);
        let placed = structures.place("level", &info, &[count])?;
        Ok(Level { ty, flags, geometry, count, placed })
    }

    fn build(&self, structures: &Structures<'_>, timestamps: &mut Timestamps, mode: Mode) -> Result<f64> {
        let geometries = [self.geometry];
        let mut info = BuildInfo::default()
            .ty(self.ty)
            .flags(self.flags)
            .mode(mode)
            .geometries(&geometries)
            .dst_acceleration_structure(self.placed.structure)
            .scratch_data(self.placed.scratch());
        if mode == Mode::UPDATE {
            info = info.src_acceleration_structure(self.placed.structure);
        }
        let range = [Range::default().primitive_count(self.count)];
        structures.device.run(Some(timestamps), |recorder| {
            recorder.phase("build");
            structures.build(recorder, &[info], &[&range])
        })?;
        Ok(timestamps.phases()?.iter().map(|p| p.milliseconds).sum())
    }
}

impl<'a> Deforming<'a> {
    /// Uploads the mesh; nothing is built yet.
    pub fn new(structures: Structures<'a>, mesh: &Mesh) -> Result<Deforming<'a>> {
        let device = structures.device;
        let positions = device.upload("positions", &mesh.positions)?;
        let indices = device.upload("indices", &mesh.triangles)?;
        let triangles = triangles_of(mesh, &positions, &indices);
        let count = mesh.triangles.len() as u32;
        let bottom_type = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
        let bottom = Level::new(&structures, bottom_type, Flags::ALLOW_UPDATE, triangles, count)?;
        let instance = Instance::new(structures.address(bottom.placed.structure), Instance::IDENTITY)
            .with_offset_and_flags(0, vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE);
        let instances = device.upload("instances", &[instance])?;
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default().data(address(&instances));
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        let top_type = vk::AccelerationStructureTypeKHR::TOP_LEVEL;
        let top = Level::new(&structures, top_type, Flags::empty(), geometry, 1)?;
        let timestamps = Timestamps::new(device, 1)?;
        Ok(Deforming { structures, positions, _indices: indices, _instances: instances, bottom, top, timestamps })
    }

    /// Moves the vertices, for the next build or update.
    pub fn set_positions(&self, positions: &[[f32; 3]]) {
        self.positions.write(positions);
    }

    /// Builds the bottom level; milliseconds by the device's timestamps.
    pub fn build(&mut self) -> Result<f64> {
        self.bottom.build(&self.structures, &mut self.timestamps, Mode::BUILD)
    }

    /// Updates the bottom level in place.
    pub fn update(&mut self) -> Result<f64> {
        self.bottom.build(&self.structures, &mut self.timestamps, Mode::UPDATE)
    }

    /// Builds the top level, whose box follows the bottom level's: before rays are traced.
    pub fn build_top(&mut self) -> Result<f64> {
        self.top.build(&self.structures, &mut self.timestamps, Mode::BUILD)
    }

    /// The head of the bottom level, of ours.
    pub fn header(&self) -> Option<Header> {
        self.bottom.placed.header()
    }

    /// Traces rays through the top level; milliseconds by the device's timestamps.
    pub fn trace(&mut self, rays: &Buffer<'_>, hits: &Buffer<'_>, count: u32, query: Query) -> Result<f64> {
        self.structures.trace(&mut self.timestamps, self.top.placed.structure, (rays, hits, count), query)
    }
}
