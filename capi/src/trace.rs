//! Rays in, hits out: [`hedgerow::trace::tracer`].

use crate::context::{HedgerowContext, context_of};
use crate::pointers::{handle, reference};
use crate::status::status;
use crate::vulkan::{VkCommandBuffer, VkDeviceAddress, VkResult};
use hedgerow::gpu::{Recorder, Region};
use hedgerow::trace::tracer::TraceBuffers;
use hedgerow::trace::{Hit, MAX_RAYS, Query, Ray, Work, bottom_level};
use hedgerow::{Error, Result};
use std::mem::offset_of;

/// A ray, 32 bytes.
///
/// It hits nothing if a component of origin or direction is NaN or infinite, if the largest component of the direction has
/// no magnitude between 2^-100 and 2^100, or if `tMin < tMax` does not hold.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct HedgerowRay {
    /// Where it starts.
    pub origin: [f32; 3],
    /// A hit counts when `tMin < t < tMax`.
    pub t_min: f32,
    /// Where it goes; need not be of unit length, `t` is in its units.
    pub direction: [f32; 3],
    /// See `tMin`.
    pub t_max: f32,
}

/// What a ray met, 16 bytes.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct HedgerowHit {
    /// Distance in units of the direction; +infinity for none. Any-hit: 0 for a hit.
    pub t: f32,
    /// The primitive, counted through all geometries of the structure; HEDGEROW_NO_HIT for none.
    pub primitive: u32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
}

/// Work that tracing one ray took, 12 bytes.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct HedgerowWork {
    /// Inner nodes visited (each tests the boxes of its two children).
    pub steps: u32,
    /// Triangles tested.
    pub tests: u32,
    /// Leaves visited.
    pub leaves: u32,
}

/// The primitive of a ray that met nothing.
pub const HEDGEROW_NO_HIT: u32 = 0xFFFF_FFFF;
/// The most rays that one call traces.
pub const HEDGEROW_MAX_RAYS: u32 = 134_217_728;

// The structures are those that the shaders know.
const _: () = {
    assert!(size_of::<HedgerowRay>() == size_of::<Ray>() && size_of::<HedgerowHit>() == size_of::<Hit>());
    assert!(offset_of!(HedgerowRay, origin) == offset_of!(Ray, origin));
    assert!(offset_of!(HedgerowRay, t_min) == offset_of!(Ray, t_min));
    assert!(offset_of!(HedgerowRay, direction) == offset_of!(Ray, direction));
    assert!(offset_of!(HedgerowRay, t_max) == offset_of!(Ray, t_max));
    assert!(offset_of!(HedgerowHit, t) == offset_of!(Hit, t));
    assert!(offset_of!(HedgerowHit, primitive) == offset_of!(Hit, primitive));
    assert!(offset_of!(HedgerowHit, u) == offset_of!(Hit, u));
    assert!(offset_of!(HedgerowHit, v) == offset_of!(Hit, v));
    assert!(size_of::<HedgerowWork>() == size_of::<Work>());
    assert!(offset_of!(HedgerowWork, steps) == offset_of!(Work, steps));
    assert!(offset_of!(HedgerowWork, tests) == offset_of!(Work, tests));
    assert!(offset_of!(HedgerowWork, leaves) == offset_of!(Work, leaves));
    assert!(HEDGEROW_NO_HIT == Hit::NONE.primitive && HEDGEROW_MAX_RAYS == MAX_RAYS);
};

/// What is asked of the rays: one of HEDGEROW_QUERY_*.
pub type HedgerowQuery = u32;
/// The nearest hit between `tMin` and `tMax`.
pub const HEDGEROW_QUERY_CLOSEST_HIT: HedgerowQuery = 0;
/// Whether there is a hit at all.
pub const HEDGEROW_QUERY_ANY_HIT: HedgerowQuery = 1;

fn query_of(query: HedgerowQuery) -> Result<Query> {
    match query {
        HEDGEROW_QUERY_CLOSEST_HIT => Ok(Query::ClosestHit),
        HEDGEROW_QUERY_ANY_HIT => Ok(Query::AnyHit),
        _ => Err(Error::Argument(format!("query is {query}; it must be one of HEDGEROW_QUERY_*"))),
    }
}

/// Device addresses of what is traced, all multiples of 16.
#[repr(C)]
pub struct HedgerowTraceInfo {
    /// What hedgerow_get_acceleration_structure_device_address returned.
    pub structure: VkDeviceAddress,
    /// HedgerowRay for each ray.
    pub rays: VkDeviceAddress,
    /// HedgerowHit for each ray, written.
    pub hits: VkDeviceAddress,
    /// HedgerowWork for each ray, written; 0 for none, which is faster.
    pub work: VkDeviceAddress,
    /// How many rays, at most HEDGEROW_MAX_RAYS.
    pub ray_count: u32,
    /// What is asked of them.
    pub query: HedgerowQuery,
}

/// Records the tracing of rays through a bottom level of triangles.
///
/// It reads and writes in compute shaders: place a barrier from what wrote structure and rays before, and one to what reads
/// the hits after, with `VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT`, `VK_ACCESS_SHADER_READ_BIT` and `VK_ACCESS_SHADER_WRITE_BIT`
/// on this side. The bound compute pipeline and the push constants are others afterwards.
///
/// # Safety
/// `commandBuffer` is being recorded, outside a render pass, on a queue with compute. The memory behind the addresses lives
/// until it has run.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hedgerow_cmd_trace_rays(
    context: *const HedgerowContext,
    command_buffer: VkCommandBuffer,
    p_info: *const HedgerowTraceInfo,
) -> VkResult {
    status(|| {
        // SAFETY: the caller's promises.
        let (context, info) = unsafe { (context_of(context)?, reference(p_info, "pInfo")?) };
        let commands = handle(command_buffer, "commandBuffer")?;
        let query = query_of(info.query)?;
        let &HedgerowTraceInfo { structure, rays, hits, work, ray_count: count, .. } = info;
        let needed = [(structure, "structure"), (rays, "rays"), (hits, "hits")];
        for (address, name) in needed.into_iter().chain((work != 0).then_some((work, "work"))) {
            if address == 0 || !address.is_multiple_of(16) {
                return Err(Error::Argument(format!(
                    "{name} is {address:#x}; it must be a multiple of 16 and not zero"
                )));
            }
        }
        let buffers = TraceBuffers {
            structure,
            rays: Region::unbounded(rays),
            hits: Region::unbounded(hits),
            work: (work != 0).then_some(Region::unbounded(work)),
            count,
        };
        // SAFETY: the caller's promises.
        let mut recorder = unsafe { Recorder::new(context, commands) };
        bottom_level::record(&mut recorder, query, &buffers)
    })
}
