//! Instances as the caller writes them, and the entries that top levels are built over.
use crate::gpu::arguments;
use crate::gpu::{Context, Kernel, Step, shaders};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// An instance, 64 bytes: `VkAccelerationStructureInstanceKHR` byte for byte, with fields that Rust can set.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Instance {
    /// Object to world, row by row. Its first three columns must have an inverse.
    pub transform: [[f32; 4]; 3],
    /// 24 bits of the caller's, and above them the mask that a ray's must share a bit with.
    pub index_and_mask: u32,
    /// 24 bits of offset in a shader binding table, and above them `vk::GeometryInstanceFlagsKHR`.
    pub offset_and_flags: u32,
    /// Address of a bottom-level structure; 0: the instance is inactive.
    pub structure: u64,
}

const _: () = assert!(size_of::<Instance>() == size_of::<vk::AccelerationStructureInstanceKHR>());

impl Instance {
    /// No transform.
    pub const IDENTITY: [[f32; 4]; 3] = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]];

    /// The structure at an address, seen by every mask, with custom index 0 and no flags.
    pub fn new(structure: u64, transform: [[f32; 4]; 3]) -> Instance {
        Instance { transform, index_and_mask: 0xff00_0000, offset_and_flags: 0, structure }
    }

    /// With another custom index (24 bits) and mask.
    pub fn with_index_and_mask(self, custom_index: u32, mask: u8) -> Instance {
        Instance { index_and_mask: custom_index & 0xff_ffff | u32::from(mask) << 24, ..self }
    }

    /// With another offset in a shader binding table (24 bits) and flags.
    pub fn with_offset_and_flags(self, offset: u32, flags: vk::GeometryInstanceFlagsKHR) -> Instance {
        Instance { offset_and_flags: offset & 0xff_ffff | flags.as_raw() << 24, ..self }
    }
}

/// Bytes of an `Entry` of instances.glsl.
pub(super) const ENTRY_BYTES: u64 = 56;

/// Writes `capacity` entries, those from `count` on without an instance. `ranges`, if not 0, is the address of the range in
/// device memory that has the number of instances, and where they begin behind `instances`.
pub(super) fn entries_step(
    context: &Context,
    instances: u64,
    pointers: bool,
    entries: u64,
    ranges: u64,
    count: u32,
    capacity: u32,
) -> Step {
    let workgroup = context.tuning.small_group;
    let kernel = Kernel::new(&shaders::ACCEL_INSTANCES_ENTRIES, workgroup, &[]);
    let pointers = u32::from(pointers);
    let arguments = arguments::Entries { instances, entries, ranges, count, capacity, pointers };
    Step::new("entries", kernel, &arguments, capacity.div_ceil(workgroup))
}
