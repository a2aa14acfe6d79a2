//! Acceleration structures by the calls and structs of `VK_KHR_acceleration_structure`, on any device with compute shaders.
//!
//! [`Device`] stands where an engine has `ash::khr::acceleration_structure::Device`: the same methods take the same structs
//! of [`ash::vk`] and record compute dispatches. What the structs can ask for and is not there is refused with an error that
//! names the field. Without those structs, use a [`Request`].
//!
//! A handle is the structure's device address, in the type that the structs want: it owns nothing, and lives as long as the
//! buffer that it lies in. That buffer needs `STORAGE_BUFFER` and `SHADER_DEVICE_ADDRESS` usage, and so does scratch memory,
//! whose address must be a multiple of [`SCRATCH_ALIGNMENT`]. Builds read and write in compute shaders: where the driver's
//! want the stage `ACCELERATION_STRUCTURE_BUILD` in a barrier, these want `COMPUTE_SHADER` with `SHADER_READ` and
//! `SHADER_WRITE`.
//!
//! A structure's bytes are the same on every device, and those of the host ([`twin::top_level`], [`crate::bvh::twin`]). So are the hits
//! of rays: where a device's division is inexact, reciprocals are rounded by integers (`glsl/gpu/reciprocal.glsl`). A shader that runs on
//! CPUs alone saves that by `#define HEDGEROW_DIVISION_IS_EXACT true` before `trace/query.glsl`.
//!
//! A structure is copied, compacted, kept in a file and brought back by the calls of the extension ([`serialize`]); what the
//! device knows of it is a [`Property`], written to an address instead of a query pool.
//!
//! Three kinds of builds, by flag. Build time and speed of rays are beside those of `PREFER_FAST_BUILD`: geometric means of the first
//! eight scenes of `docs/results.md` and seven kinds of rays through the tracers, on Mesa 26's lavapipe (`hedgerow bench -b
//! lbvh:codes=emc64var/24,hploc,hploc:width=8q,hploc:width=8q:optimise=0.75,hploc:width=8q:optimise=fast`, 30 November 2026, an AMD EPYC without AVX-512). Those of the third are
//! [nodes of eight](Wide), and those of the second in bottom levels of 4,096 primitives and more.
//!
//! | preference | bottom levels | top levels | build | rays |
//! | --- | --- | --- | --- | --- |
//! | `PREFER_FAST_BUILD` | an LBVH by codes of 8 bits less | the same | 1.0 | 1.0 |
//! | none | H-PLOC, of over 2,048 primitives: of those measured the least time for a build and ten rays a triangle, 0.62 of an LBVH's (0.68 and 0.71 with three quarters of a pass of reinsertion and a whole one, 0.87 in nodes of two) | an LBVH and three quarters of a pass of [reinsertion](crate::bvh::reinsertion) | 3.8 (2.2 in nodes of two) | 1.81 (1.19) |
//! | `PREFER_FAST_TRACE` | H-PLOC and a pass of reinsertion, three quarters of one from 262,145 primitives on, one and a half up to 32,768, two up to 2,048 | the same as without, but for a quarter of a pass in nodes of eight, none over more than 16,384 entries, and opens instances ([`REBRAID`]) | 10.3 | 2.01 |
//!
//! H-PLOC begins with pairs of triangles that share an edge, in structures of over 2,048.
//!
//! What other flags change:
//!
//! | flag | |
//! | --- | --- |
//! | `LOW_MEMORY` | larger leaves, so that compacted copies are smaller; codes of at most 32 bits: 20 bytes of scratch a primitive instead of 28, from 4 million on |
//! | `ALLOW_UPDATE` | `UPDATE` may follow: boxes move with their primitives, the tree stays ([`crate::bvh::refit`]); no re-braiding, as an opened instance cannot be refitted |
//! | `ALLOW_COMPACTION` | larger leaves, as with `LOW_MEMORY`; every structure can be compacted |
//! | [`REBRAID`] | a top level opens instances whose boxes are loose |
//! | [`ANY_HIT_ORDER`] | children have an order for rays that end at their first hit |

mod build;
mod checked;
mod copy;
mod device;
mod geometry;
mod given;
mod host;
mod instances;
mod properties;
mod quality;
mod rebraid;
mod request;
pub mod serialize;
mod tree;
pub mod twin;

pub use build::SCRATCH_ALIGNMENT;
pub use device::{Device, STRUCTURE_ALIGNMENT};
pub use instances::Instance;
pub use properties::Property;
pub use request::{Placement, Request};
pub use tree::Tree;

use crate::bvh::codes::Codes;
use ash::vk;

/// A build flag of hedgerow's own: a top level may open instances (Benthin, Woop, Wald 2017), within
/// [`AccelOptions::rebraid_budget`].
pub const REBRAID: vk::BuildAccelerationStructureFlagsKHR = vk::BuildAccelerationStructureFlagsKHR::from_raw(1 << 30);

/// Another of hedgerow's own: the children of all nodes get an order for rays that end at their first hit, by
/// [`ChildOrder::MoreHitsForItsCost`](crate::bvh::child_order::ChildOrder::MoreHitsForItsCost). Queries with `TerminateOnFirstHit` then look into the left child first instead of the nearer one.
/// Which of them hit something stays the same, and so does everything about other queries. Updates and copies keep the order. A flag and
/// no choice of the device: each structure that shadow rays meet pays for its own, at the bottom and at the top.
pub const ANY_HIT_ORDER: vk::BuildAccelerationStructureFlagsKHR =
    vk::BuildAccelerationStructureFlagsKHR::from_raw(1 << 29);

/// Which structures get quantised nodes of eight children ([`crate::bvh::wide`]) in place of nodes of two: of those that allow no update,
/// bottom levels that are not LBVHs, and top levels but for those of `PREFER_FAST_BUILD`. They stand beside others in either level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wide {
    /// None: shaders may leave them out by `HEDGEROW_FORMS` (`glsl/trace/query_walk.glsl`), and [`crate::trace::tracer`] traces all bottom
    /// levels.
    Never,
    /// All of `PREFER_FAST_TRACE`, and bottom levels of 4,096 primitives and more without a preference. They take 35 to 40 bytes a triangle
    /// compacted where nodes of two take 50 to 62 (docs/notes/memory.md), and rays are faster. Rays that meet both forms are slower than
    /// those that meet one: so a top level without a preference has nodes of two, as the small structures below it have (docs/notes/rays.md).
    #[default]
    ByFlags,
    /// All.
    Always,
}

/// Choices of a [`Device`] that Vulkan's structs have no field for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccelOptions {
    /// Entries of a top level that opens instances ([`REBRAID`], `PREFER_FAST_TRACE`), as a multiple of its instances. At 1 and below
    /// none is opened.
    pub rebraid_budget: f32,
    /// The codes that bottom levels are sorted by; `None` takes [`Codes::for_count`]. Flags do not change those that are given.
    pub bottom_codes: Option<Codes>,
    /// The same of top levels; `None` takes those by number, too, but with [`CodeBounds::Apart`](crate::bvh::codes::CodeBounds::Apart),
    /// as an instance far from the others would put them all into one cell, and with as many bits as the device finds that the instances' spread needs ([`BuildOptions::bits_up_to`](crate::bvh::builder::BuildOptions::bits_up_to)).
    pub top_codes: Option<Codes>,
    /// Which structures get nodes of eight children.
    pub wide: Wide,
    /// Whether calls are checked against what was created and built, as Vulkan's validation would: memory that is too
    /// small or overlaps, misaligned data, updates without the flag or of changed counts. They return an error before anything
    /// is recorded. Structures must then be created, built and destroyed through this device and its clones. For debugging:
    /// each call takes a lock.
    pub checked: bool,
}

impl AccelOptions {
    /// Four times as many entries as instances: where scenes of all kinds whose boxes are loose gain, and memory is spared. No checks.
    pub const DEFAULT: AccelOptions =
        AccelOptions { rebraid_budget: 4.0, bottom_codes: None, top_codes: None, wide: Wide::ByFlags, checked: false };
    /// The same with checks.
    pub const CHECKED: AccelOptions = AccelOptions { checked: true, ..AccelOptions::DEFAULT };
}

impl Default for AccelOptions {
    fn default() -> AccelOptions {
        AccelOptions::DEFAULT
    }
}
