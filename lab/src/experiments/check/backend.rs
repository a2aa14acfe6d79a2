//! Building and tracing structures by the calls of `VK_KHR_acceleration_structure`, behind one trait: ours here, the driver's in
//! the tests, so that one table of cases runs through both.

use super::probe::{Probe, ProbeRay, ProbeReport};
use crate::device::{Buffer, Device};
pub use crate::subjects::structures::BuildInfo;
use crate::subjects::structures::{BuildSizes, Range, Structure, Structures};
use ash::vk;
use hedgerow::accel::{self, SCRATCH_ALIGNMENT};
use hedgerow::bvh::layout::{self, Header};
use hedgerow::gpu::Recorder;

/// How many primitives of each geometry.
pub type Ranges<'a> = &'a [Range];

/// What an engine calls.
pub trait Backend {
    /// The calls.
    fn structures(&self) -> &Structures<'static>;
    /// `minAccelerationStructureScratchOffsetAlignment`.
    fn scratch_alignment(&self) -> u64;
    /// What queries through a top level report.
    fn probe(&self, structure: Structure, rays: &[ProbeRay]) -> Vec<ProbeReport>;

    /// Whose it is.
    fn name(&self) -> &'static str {
        self.structures().maker().name()
    }

    /// The device that everything lies on.
    fn device(&self) -> &'static Device {
        self.structures().device
    }

    /// `vkGetAccelerationStructureBuildSizesKHR`.
    fn build_sizes(&self, info: &BuildInfo<'_>, counts: &[u32]) -> BuildSizes {
        self.structures().sizes(info, counts).expect("it can be built")
    }

    /// `vkCreateAccelerationStructureKHR`.
    fn create(&self, info: &vk::AccelerationStructureCreateInfoKHR<'_>) -> Structure {
        self.structures().create(info).expect("the offset is right")
    }

    /// `vkDestroyAccelerationStructureKHR`.
    fn destroy(&self, structure: Structure) {
        self.structures().destroy(structure);
    }

    /// `vkGetAccelerationStructureDeviceAddressKHR`.
    fn address(&self, structure: Structure) -> u64 {
        self.structures().address(structure)
    }

    /// `vkCmdBuildAccelerationStructuresKHR`, with a barrier behind it.
    fn build(&self, recorder: &mut Recorder<'_>, infos: &[BuildInfo<'_>], ranges: &[Ranges<'_>]) {
        self.structures().build(recorder, infos, ranges).expect("it can be built");
    }
}

/// Ours: the calls of [`accel::Device`], and queries in a shader that includes our header.
pub struct Ours(pub accel::Device<'static>, Probe, Structures<'static>);

impl Ours {
    /// The defaults, but for nodes of eight where there can be: beside nodes of two, so that queries meet both.
    pub const OPTIONS: accel::AccelOptions =
        accel::AccelOptions { wide: accel::Wide::Always, ..accel::AccelOptions::DEFAULT };

    /// With [`Ours::OPTIONS`].
    pub fn on(device: &'static Device) -> Ours {
        Ours::with_options(device, Ours::OPTIONS)
    }

    /// With these options.
    pub fn with_options(device: &'static Device, options: accel::AccelOptions) -> Ours {
        let calls = accel::Device::with_options(device, options);
        Ours(calls.clone(), Probe::ours(device), Structures::of(device, calls))
    }
}

impl Backend for Ours {
    fn structures(&self) -> &Structures<'static> {
        &self.2
    }

    fn scratch_alignment(&self) -> u64 {
        SCRATCH_ALIGNMENT
    }

    fn probe(&self, structure: Structure, rays: &[ProbeRay]) -> Vec<ProbeReport> {
        self.1.ask(self.address(structure), rays)
    }
}

/// A structure that was built alone, and its memory.
pub struct Built {
    /// Its handle.
    pub structure: Structure,
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
        submit_build(backend, &info, ranges).expect("it builds");
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

    /// The bytes of one of ours that are in use: a structure of nodes of eight rarely needs all that it was given.
    ///
    /// # Panics
    /// It is no structure of ours.
    pub fn bytes_in_use(&self) -> Vec<u8> {
        let mut bytes: Vec<u8> = self.memory.read(self.bytes as usize);
        let header: Header = bytemuck::pod_read_unaligned(&bytes[..size_of::<Header>()]);
        let record_bytes = layout::record_bytes(header.kind).expect("a structure of ours");
        bytes.truncate(header.offsets(record_bytes).bytes as usize);
        bytes
    }

    /// Scratch memory for it, and its address.
    pub fn scratch(&self, backend: &dyn Backend, info: &BuildInfo<'_>, counts: &[u32]) -> (Buffer<'static>, u64) {
        scratch_of(backend, backend.build_sizes(info, counts).build_scratch_size)
    }
}

/// So much scratch memory, and its address.
///
/// # Panics
/// There is too little memory.
pub fn scratch_of(backend: &dyn Backend, bytes: u64) -> (Buffer<'static>, u64) {
    let alignment = backend.scratch_alignment();
    let buffer = backend.device().buffer("scratch", bytes + 2 * alignment).expect("memory");
    // As little aligned as is allowed.
    let address = buffer.address().next_multiple_of(alignment) + alignment;
    (buffer, address)
}

/// Builds or updates by itself.
///
/// # Errors
/// The device failed.
pub fn submit_build(backend: &dyn Backend, info: &BuildInfo<'_>, ranges: Ranges<'_>) -> crate::Result<()> {
    let record = |recorder: &mut Recorder<'_>| {
        backend.build(recorder, &[*info], &[ranges]);
        Ok(())
    };
    backend.device().run(None, record)
}
