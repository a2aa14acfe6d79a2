//! One level of acceleration structures: what it is built over, and where it lies.

use super::device_rays::timed_run;
use super::structures::{BuildInfo, BuildSizes, Geometry, Range, Structure, Structures, instances_at, triangles_of};
use crate::Result;
use crate::device::Buffer;
use crate::experiments::accel::points::Implementation;
use crate::scene::Mesh;
use ash::vk;
use hedgerow::accel::Instance;
use hedgerow::bvh::layout::Header;
use hedgerow::gpu::{Recorder, Timestamps};

type Flags = vk::BuildAccelerationStructureFlagsKHR;
type Mode = vk::BuildAccelerationStructureModeKHR;
type Type = vk::AccelerationStructureTypeKHR;

/// A structure with its memory, and what it is built over.
pub struct Level<'a> {
    owner: Structures<'a>,
    ty: Type,
    flags: Flags,
    geometry: [Geometry; 1],
    /// How many triangles or instances.
    pub(super) count: u32,
    structure: Structure,
    sizes: BuildSizes,
    memory: Buffer<'a>,
    scratch: Buffer<'a>,
    /// Positions and indices, or instances.
    inputs: Vec<Buffer<'a>>,
}

impl<'a> Level<'a> {
    /// Memory for a bottom level over a mesh, which is uploaded; nothing is built yet.
    ///
    /// # Errors
    /// Too little memory.
    pub fn bottom(structures: &Structures<'a>, mesh: &Mesh, flags: Flags) -> Result<Level<'a>> {
        let positions = structures.device.upload("positions", &mesh.positions)?;
        let indices = structures.device.upload("indices", &mesh.triangles)?;
        let (geometry, count) = (triangles_of(mesh, &positions, &indices), mesh.triangles.len() as u32);
        Level::new(structures, (Type::BOTTOM_LEVEL, flags), geometry, count, vec![positions, indices])
    }

    /// Memory for a top level over instances, which are uploaded; nothing is built yet.
    ///
    /// # Errors
    /// Too little memory.
    pub fn top(structures: &Structures<'a>, instances: &[Instance], flags: Flags) -> Result<Level<'a>> {
        let buffer = structures.device.upload("instances", instances)?;
        let geometry = instances_at(buffer.address(), false);
        Level::new(structures, (Type::TOP_LEVEL, flags), geometry, instances.len() as u32, vec![buffer])
    }

    fn new(
        structures: &Structures<'a>,
        (ty, flags): (Type, Flags),
        geometry: Geometry,
        count: u32,
        inputs: Vec<Buffer<'a>>,
    ) -> Result<Level<'a>> {
        let geometry = [geometry];
        let info = BuildInfo::default().ty(ty).flags(flags).geometries(&geometry);
        let (owner, sizes) = (structures.clone(), structures.sizes(&info, &[count])?);
        let memory = owner.device.buffer("level", sizes.acceleration_structure_size)?;
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(memory.raw())
            .size(sizes.acceleration_structure_size)
            .ty(ty);
        let structure = owner.create(&create)?;
        // The largest alignment that a driver may ask for.
        let scratch = owner.device.buffer("scratch", sizes.build_scratch_size.max(sizes.update_scratch_size) + 256)?;
        Ok(Level { owner, ty, flags, geometry, count, structure, sizes, memory, scratch, inputs })
    }

    /// An instance of it with both sides of its triangles.
    pub fn instance(&self, structures: &Structures<'_>, transform: [[f32; 4]; 3]) -> Instance {
        Instance::new(structures.address(self.structure()), transform)
            .with_offset_and_flags(0, vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE)
    }

    /// The structure.
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// The positions of a mesh, or the instances.
    pub fn input(&self) -> &Buffer<'a> {
        &self.inputs[0]
    }

    /// Frees what it was built over: it is not built again.
    pub fn without_inputs(mut self) -> Level<'a> {
        self.inputs.clear();
        self
    }

    /// Its head, where it is one of ours.
    pub fn header(&self) -> Option<Header> {
        (self.owner.maker() == Implementation::Ours).then(|| self.memory.read::<Header>(1)[0])
    }

    /// The memory of the structure, as it is.
    pub(super) fn structure_bytes(&self) -> Vec<u8> {
        self.memory.read(self.sizes.acceleration_structure_size as usize)
    }

    /// Bytes of the structure, and of the scratch memory of a build.
    pub fn bytes(&self) -> [u64; 2] {
        [self.sizes.acceleration_structure_size, self.sizes.build_scratch_size]
    }

    /// What a build call takes.
    pub fn info(&self, mode: Mode) -> BuildInfo<'_> {
        let scratch = vk::DeviceOrHostAddressKHR { device_address: self.scratch.address().next_multiple_of(256) };
        let info = BuildInfo::default()
            .ty(self.ty)
            .flags(self.flags)
            .mode(mode)
            .geometries(&self.geometry)
            .dst_acceleration_structure(self.structure)
            .scratch_data(scratch);
        if mode == Mode::UPDATE { info.src_acceleration_structure(self.structure) } else { info }
    }

    /// How many of what it is built over.
    pub fn range(&self) -> [Range; 1] {
        [Range::default().primitive_count(self.count)]
    }

    /// Records a build or an update.
    ///
    /// # Errors
    /// It cannot be recorded.
    pub fn record(&self, structures: &Structures<'_>, recorder: &mut Recorder<'_>, mode: Mode) -> hedgerow::Result<()> {
        structures.build(recorder, &[self.info(mode)], &[&self.range()])
    }

    /// Builds or updates it by itself; milliseconds by the device's timestamps.
    ///
    /// # Errors
    /// It cannot be recorded or run.
    pub fn build(&self, structures: &Structures<'_>, timestamps: &mut Timestamps, mode: Mode) -> Result<f64> {
        timed_run(structures.device, timestamps, "build", |recorder| self.record(structures, recorder, mode))
    }
}

impl Drop for Level<'_> {
    fn drop(&mut self) {
        self.owner.destroy(self.structure);
    }
}
