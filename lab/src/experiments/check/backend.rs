//! Who builds and traces structures by the calls of `VK_KHR_acceleration_structure`, behind one trait: ours here, the driver's in
//! the tests, so that one table of cases runs through both.

use super::probe::{Probe, ProbeRay, ProbeReport};
use crate::device::{Buffer, Device};
use ash::vk;
use hedgerow::accel::{self, SCRATCH_ALIGNMENT};
use hedgerow::gpu::Recorder;
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::{Hit, Query, Ray};

/// What a build call takes.
pub type BuildInfo<'a> = vk::AccelerationStructureBuildGeometryInfoKHR<'a>;
/// How many primitives of each geometry.
pub type Ranges<'a> = &'a [vk::AccelerationStructureBuildRangeInfoKHR];

/// What an engine calls.
pub trait Backend {
    /// Whose it is.
    fn name(&self) -> &'static str;
    /// The device that everything lies on.
    fn device(&self) -> &'static Device;
    /// `vkGetAccelerationStructureBuildSizesKHR`.
    fn build_sizes(&self, info: &BuildInfo<'_>, counts: &[u32]) -> vk::AccelerationStructureBuildSizesInfoKHR<'static>;
    /// `vkCreateAccelerationStructureKHR`.
    fn create(&self, info: &vk::AccelerationStructureCreateInfoKHR<'_>) -> vk::AccelerationStructureKHR;
    /// `vkDestroyAccelerationStructureKHR`.
    fn destroy(&self, structure: vk::AccelerationStructureKHR);
    /// `vkGetAccelerationStructureDeviceAddressKHR`.
    fn address(&self, structure: vk::AccelerationStructureKHR) -> u64;
    /// `vkCmdBuildAccelerationStructuresKHR`.
    fn build(&self, recorder: &mut Recorder<'_>, infos: &[BuildInfo<'_>], ranges: &[Ranges<'_>]);
    /// `minAccelerationStructureScratchOffsetAlignment`.
    fn scratch_alignment(&self) -> u64;
    /// What queries through a top level report.
    fn probe(&self, structure: vk::AccelerationStructureKHR, rays: &[ProbeRay]) -> Vec<ProbeReport>;
    /// The hits of rays in a bottom-level structure.
    fn trace(&self, structure: vk::AccelerationStructureKHR, rays: &[Ray]) -> Vec<Hit>;
}

/// Ours: the calls of [`accel::Device`], and queries in a shader that includes our header.
pub struct Ours(pub accel::Device<'static>, Probe, &'static Device);

impl Ours {
    /// With the defaults.
    pub fn on(device: &'static Device) -> Ours {
        Ours::with_options(device, accel::AccelOptions::DEFAULT)
    }

    /// With these options.
    pub fn with_options(device: &'static Device, options: accel::AccelOptions) -> Ours {
        Ours(accel::Device::with_options(device, options), Probe::ours(device), device)
    }
}

impl Backend for Ours {
    fn name(&self) -> &'static str {
        "hedgerow"
    }

    fn device(&self) -> &'static Device {
        self.2
    }

    fn build_sizes(&self, info: &BuildInfo<'_>, counts: &[u32]) -> vk::AccelerationStructureBuildSizesInfoKHR<'static> {
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let place = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        unsafe { self.0.get_acceleration_structure_build_sizes(place, info, counts, &mut sizes) }
            .expect("it can be built");
        sizes
    }

    fn create(&self, info: &vk::AccelerationStructureCreateInfoKHR<'_>) -> vk::AccelerationStructureKHR {
        unsafe { self.0.create_acceleration_structure(info, None) }.expect("the offset is right")
    }

    fn destroy(&self, structure: vk::AccelerationStructureKHR) {
        self.0.destroy_acceleration_structure(structure, None);
    }

    fn address(&self, structure: vk::AccelerationStructureKHR) -> u64 {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(structure);
        self.0.get_acceleration_structure_device_address(&info)
    }

    fn build(&self, recorder: &mut Recorder<'_>, infos: &[BuildInfo<'_>], ranges: &[Ranges<'_>]) {
        unsafe { self.0.cmd_build_acceleration_structures(recorder.commands(), infos, ranges) }
            .expect("it can be built");
    }

    fn scratch_alignment(&self) -> u64 {
        SCRATCH_ALIGNMENT
    }

    fn probe(&self, structure: vk::AccelerationStructureKHR, rays: &[ProbeRay]) -> Vec<ProbeReport> {
        self.1.ask(self.address(structure), rays)
    }

    fn trace(&self, structure: vk::AccelerationStructureKHR, rays: &[Ray]) -> Vec<Hit> {
        let count = rays.len() as u32;
        let ray_buffer = self.2.upload("rays", rays).expect("memory");
        let hits = self.2.buffer("hits", size_of::<Hit>() as u64 * u64::from(count)).expect("memory");
        let structure = self.address(structure);
        let buffers = TraceBuffers { structure, rays: ray_buffer.region(), hits: hits.region(), work: None, count };
        let shape = TraceShape::of(self.2);
        self.2.run(None, |r| tracer::record(r, &shape, Query::ClosestHit, &buffers)).expect("it traces");
        hits.read(rays.len())
    }
}

/// A structure that was built alone, and its memory.
pub struct Built {
    /// Its handle.
    pub structure: vk::AccelerationStructureKHR,
    /// Where it lies.
    pub memory: Buffer<'static>,
    /// Bytes of it, and of what lies before it.
    pub bytes: u64,
}

impl Built {
    /// Builds what `info` asks for, in a buffer of its own, `offset` bytes behind its beginning.
    pub fn new(backend: &dyn Backend, info: &BuildInfo<'_>, ranges: Ranges<'_>, offset: u64) -> Built {
        let counts: Vec<u32> = ranges.iter().map(|r| r.primitive_count).collect();
        let mut built = Built::place(backend, info, &counts, offset);
        let scratch = built.scratch(backend, info, &counts);
        let info = info
            .dst_acceleration_structure(built.structure)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch.1 });
        backend
            .device()
            .run(None, |recorder| {
                backend.build(recorder, &[info], &[ranges]);
                Ok(())
            })
            .expect("it builds");
        built.bytes -= offset;
        built
    }

    /// Memory and a handle; nothing is built.
    pub fn place(backend: &dyn Backend, info: &BuildInfo<'_>, counts: &[u32], offset: u64) -> Built {
        let bytes = backend.build_sizes(info, counts).acceleration_structure_size;
        let memory = backend.device().buffer("structure", offset + bytes).expect("memory");
        let create = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(memory.raw())
            .offset(offset)
            .size(bytes)
            .ty(info.ty);
        Built { structure: backend.create(&create), memory, bytes: offset + bytes }
    }

    /// Scratch memory for it, and its address.
    pub fn scratch(&self, backend: &dyn Backend, info: &BuildInfo<'_>, counts: &[u32]) -> (Buffer<'static>, u64) {
        let alignment = backend.scratch_alignment();
        let bytes = backend.build_sizes(info, counts).build_scratch_size;
        let buffer = backend.device().buffer("scratch", bytes + 2 * alignment).expect("memory");
        // As little aligned as is allowed.
        let address = buffer.address().next_multiple_of(alignment) + alignment;
        (buffer, address)
    }
}
