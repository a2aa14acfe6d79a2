//! Builds without Vulkan's structs: what a structure is made of, in the types of [`crate::bvh::geometry`].
//!
//! ```no_run
//! # use hedgerow::{accel::{Device, Instance, Placement, Request}, bvh::geometry::Geometry, gpu::Region, Result};
//! # fn example(device: &Device<'_>, commands: hedgerow::ash::vk::CommandBuffer,
//! #            positions: u64, indices: u64, allocate: impl Fn(u64) -> Region) -> Result<()> {
//! let mesh = Request::triangles(&[(Geometry::mesh(positions, 100, indices), 160)]);
//! let sizes = mesh.sizes(device)?;
//! let [structure, scratch] = [allocate(sizes.structure), allocate(sizes.scratch)];
//! // SAFETY: `commands` is being recorded; all addresses stay valid until it has run.
//! unsafe { device.record(commands, &[Placement { request: &mesh, structure, scratch }]) }?;
//! # Ok(())
//! # }
//! ```

use super::Device;
use super::build::{Build, Counts};
use super::geometry::BuildGeometries;
use crate::Result;
use crate::bvh::geometry::Geometry;
use crate::gpu::{Region, Sizes};
use ash::vk;

/// What to build: geometries or instances, and flags.
#[derive(Debug, Clone)]
pub struct Request {
    pub(super) given: BuildGeometries,
    pub(super) primitive_count: u64,
    pub(super) flags: vk::BuildAccelerationStructureFlagsKHR,
}

/// A request with its memory, of [`Request::sizes`].
#[derive(Debug, Clone, Copy)]
pub struct Placement<'a> {
    /// What to build.
    pub request: &'a Request,
    /// Memory for the structure.
    pub structure: Region,
    /// Scratch memory.
    pub scratch: Region,
}

impl Request {
    /// A bottom-level structure of triangles: each geometry with the number of its triangles. Their `first` follows from that.
    pub fn triangles(geometries: &[(Geometry, u32)]) -> Request {
        let (geometries, primitive_count) = in_order(geometries);
        Request::new(BuildGeometries::Triangles(geometries), primitive_count)
    }

    /// A bottom-level structure of boxes: each geometry ([`Geometry::boxes`]) with the number of its boxes.
    pub fn boxes(geometries: &[(Geometry, u32)]) -> Request {
        let (geometries, primitive_count) = in_order(geometries);
        Request::new(BuildGeometries::Boxes(geometries), primitive_count)
    }

    /// A top level over `count` [`Instance`](super::Instance)s at an address that is a multiple of 16.
    pub fn instances(address: u64, count: u32) -> Request {
        Request::new(BuildGeometries::Instances { data: address, pointers: false }, count.into())
    }

    /// A top level over `count` instances whose addresses lie at an address that is a multiple of 8.
    pub fn instance_pointers(address: u64, count: u32) -> Request {
        Request::new(BuildGeometries::Instances { data: address, pointers: true }, count.into())
    }

    fn new(given: BuildGeometries, primitive_count: u64) -> Request {
        Request { given, primitive_count, flags: vk::BuildAccelerationStructureFlagsKHR::empty() }
    }

    /// The same request with these build flags.
    pub fn with_flags(self, flags: vk::BuildAccelerationStructureFlagsKHR) -> Request {
        Request { flags, ..self }
    }

    /// The memory that the build needs.
    ///
    /// # Errors
    /// Unknown flags, or two that exclude each other; too many primitives.
    pub fn sizes(&self, device: &Device<'_>) -> Result<Sizes> {
        Ok(Sizes { alignment: super::STRUCTURE_ALIGNMENT, ..self.build(device)?.sizes() })
    }

    pub(super) fn build(&self, device: &Device<'_>) -> Result<Build> {
        Build::new(
            device.context,
            device.options(),
            self.flags,
            self.given.clone(),
            Counts::OnHost,
            self.primitive_count,
        )
    }
}

/// The geometries with the `first` that follows from the counts, and how many primitives they have in all.
fn in_order(geometries: &[(Geometry, u32)]) -> (Vec<Geometry>, u64) {
    let mut total = 0u64;
    let placed = geometries.iter().map(|&(geometry, count)| {
        // Too many are refused by the builder.
        let first = total as u32;
        total += u64::from(count);
        Geometry { first, ..geometry }
    });
    (placed.collect(), total)
}
