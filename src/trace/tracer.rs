//! The tracer on the device: rays in, hits out, recorded into the caller's command buffer.
//!
//! ```no_run
//! # use hedgerow::{gpu::{Recorder, Region}, trace::{Query, tracer::{self, TraceBuffers, TraceShape}}};
//! # fn example(recorder: &mut Recorder<'_>, structure: u64, rays: Region, hits: Region) -> hedgerow::Result<()> {
//! let shape = TraceShape::of(recorder.context());
//! tracer::record(recorder, &shape, Query::ClosestHit, &TraceBuffers { structure, rays, hits, work: None, count: 1 << 20 })?;
//! recorder.barrier();
//! # Ok(())
//! # }
//! ```

use super::{Hit, MAX_RAYS, Query, Ray, Work};
use crate::bvh::layout::MAX_DEPTH;
use crate::gpu::arguments;
use crate::gpu::{Context, Kernel, Limits, MOST_LANES, Recorder, Region, shaders};
use crate::{Error, Result};

/// How a trace is divided into workgroups on a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct TraceShape {
    /// Invocations of a workgroup.
    pub workgroup: u32,
    /// How many entries of each ray's stack lie in shared memory; the others are private. At most
    /// [`MAX_DEPTH`].
    pub shared_levels: u32,
    /// The most rays that an invocation traces one after the other.
    pub rays_each: u32,
    /// How nodes and triangles are loaded.
    pub loads: Loads,
}

/// How the lanes of a subgroup load what each of them needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Loads {
    /// Each for itself, member by member (`glsl/trace/tracer/single.comp`).
    Gathered,
    /// Each for itself, in vectors of 64 and 128 bits (`glsl/trace/vector_loads.glsl`): for GPUs, where the number of loads counts.
    InVectors,
    /// Each for itself, in elements of 64 bits (`glsl/trace/long_loads.glsl`): for CPUs, where lanes gather. The device must have
    /// [`Optional::int64`](crate::gpu::Optional::int64).
    InLongs,
    /// One lane after the other (`glsl/trace/tracer/lanes.comp`): 1.2 to 1.4 times as fast where a CPU's driver makes plain
    /// loads of it. The workgroup must be one subgroup, of at most [`Loads::MAX_LANES`].
    LaneByLane,
}

impl Loads {
    /// Lanes that can load one after the other.
    pub const MAX_LANES: u32 = MOST_LANES;
}

impl TraceShape {
    /// The shape that is fast on this device.
    pub fn of(context: &Context) -> TraceShape {
        let tuning = &context.tuning.trace;
        let shape = TraceShape {
            workgroup: tuning.group,
            shared_levels: tuning.shared_levels.min(MAX_DEPTH),
            rays_each: tuning.rays_each,
            loads: match () {
                () if tuning.lane_by_lane => Loads::LaneByLane,
                () if tuning.in_vectors => Loads::InVectors,
                () if tuning.in_longs => Loads::InLongs,
                () => Loads::Gathered,
            },
        };
        shape.within(&context.limits)
    }

    /// For CPUs: workgroups of one subgroup, so that none waits for another, and the whole stack in shared memory, which is
    /// memory like any other but laid out in columns. An invocation takes ray after ray, so that it need not wait for the
    /// longest of its subgroup.
    pub fn subgroups(limits: &Limits) -> TraceShape {
        let loads = Loads::Gathered;
        TraceShape { workgroup: limits.subgroup_size, shared_levels: MAX_DEPTH, rays_each: 128, loads }.within(limits)
    }

    /// The same with loads lane by lane, for subgroups of at most [`Loads::MAX_LANES`].
    pub fn lanes(limits: &Limits) -> TraceShape {
        TraceShape { loads: Loads::LaneByLane, ..TraceShape::subgroups(limits) }
    }

    /// For GPUs: larger workgroups, and the few levels in shared memory that most rays stay in.
    pub fn groups(limits: &Limits) -> TraceShape {
        let workgroup = limits.subgroup_size.max(64);
        TraceShape { workgroup, shared_levels: 8, rays_each: 1, loads: Loads::InVectors }.within(limits)
    }

    /// Rays of an invocation where there are `count`: enough workgroups that all cores have some to the end.
    pub(super) fn rays_each_of(&self, count: u32) -> u32 {
        (count / (self.workgroup * LEAST_WORKGROUPS)).clamp(1, self.rays_each)
    }

    /// With no more levels in shared memory than there is room for.
    pub(super) fn within(self, limits: &Limits) -> TraceShape {
        let workgroup = self.workgroup.min(limits.workgroup_invocations);
        let level_bytes = LEVEL_BYTES * workgroup;
        // One word more of each of the two arrays: they must not be empty.
        let room = limits.shared_memory.saturating_sub(LEVEL_BYTES) / level_bytes;
        TraceShape { workgroup, shared_levels: self.shared_levels.min(room), ..self }
    }
}

/// Workgroups that are worth more than rays that follow each other in one.
const LEAST_WORKGROUPS: u32 = 64;
/// Shared memory an entry of a stack: node or first triangle with its count, and distance.
const LEVEL_BYTES: u32 = 8;

/// Structure, rays and memory of a trace, all aligned to 16 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceBuffers {
    /// Address of a `Bvh2`, or of another structure if the tracer takes it. One of another kind than the tracer's is traced as if it
    /// were empty, and so is one whose status says that it is too deep or unfinished. [`super::bottom_level`] takes whatever bottom levels
    /// of [`crate::accel`] are.
    pub structure: u64,
    /// [`Ray`] × `count`.
    pub rays: Region,
    /// [`Hit`] × `count`, written.
    pub hits: Region,
    /// [`Work`] × `count`, written: counting takes time, so it has a kernel of its own.
    pub work: Option<Region>,
    /// The number of rays, at most [`MAX_RAYS`].
    pub count: u32,
}

/// The shader that tracing in a `Bvh2` takes.
fn shader(shape: &TraceShape) -> &'static shaders::Shader {
    match shape.loads {
        Loads::Gathered | Loads::InVectors => &shaders::TRACE_TRACER_SINGLE,
        Loads::InLongs => &shaders::TRACE_TRACER_SINGLE_INT64,
        Loads::LaneByLane => &shaders::TRACE_TRACER_LANES,
    }
}

/// The constants of all tracers.
fn constants(shape: &TraceShape, query: Query, count_work: bool) -> [u32; 5] {
    let any_hit = u32::from(query == Query::AnyHit);
    let lanes = shape.workgroup.min(Loads::MAX_LANES);
    let in_vectors = u32::from(shape.loads == Loads::InVectors);
    [any_hit, u32::from(count_work), shape.shared_levels, lanes, in_vectors]
}

/// The kernel of a shader that takes the constants of the tracers.
pub(super) fn kernel_of(
    shader: &'static shaders::Shader,
    shape: &TraceShape,
    query: Query,
    count_work: bool,
) -> Kernel {
    Kernel::new(shader, shape.workgroup, &constants(shape, query, count_work))
}

/// The same for rays that end at any hit, left children first.
pub(super) fn kernel_left_first(shader: &'static shaders::Shader, shape: &TraceShape, count_work: bool) -> Kernel {
    let [any_hit, count_work, shared_levels, lanes, in_vectors] = constants(shape, Query::AnyHit, count_work);
    let left_first = 1;
    Kernel::new(shader, shape.workgroup, &[any_hit, count_work, shared_levels, lanes, in_vectors, left_first])
}

/// The kernel of an octant's shader that leaves hits as they are where the structure is not of its kind.
pub(super) fn kernel_where_it_is(
    shader: &'static shaders::Shader,
    shape: &TraceShape,
    query: Query,
    count_work: bool,
) -> Kernel {
    let [any_hit, count_work, shared_levels, lanes, in_vectors] = constants(shape, query, count_work);
    let (left_first, leaves_others) = (0, 1);
    let constants = [any_hit, count_work, shared_levels, lanes, in_vectors, left_first, leaves_others];
    Kernel::new(shader, shape.workgroup, &constants)
}

/// Records the tracing of all rays: one dispatch, or several if the device cannot take all workgroups in one.
///
/// Rays, structure and hits must be visible to and not used by other shaders before: the caller places a barrier (shader
/// write to shader read and write) before and after.
///
/// # Errors
/// More than [`MAX_RAYS`] rays, or than the memory holds; loads lane by lane in workgroups that are not one subgroup of at most
/// [`Loads::MAX_LANES`], or of 64 bits without [`Optional::int64`](crate::gpu::Optional::int64); the kernel's pipeline could not be made.
pub fn record(recorder: &mut Recorder<'_>, shape: &TraceShape, query: Query, buffers: &TraceBuffers) -> Result<()> {
    record_kernel(recorder, &kernel_of(shader(shape), shape, query, buffers.work.is_some()), shape, buffers)
}

/// The same for rays that end at any hit, in a `Bvh2` whose children are in an order (`bvh::child_order`): the left child of each node
/// comes first, wherever it is, and no distances are kept.
///
/// # Errors
/// As [`record`].
pub fn record_left_first(recorder: &mut Recorder<'_>, shape: &TraceShape, buffers: &TraceBuffers) -> Result<()> {
    let kernel = kernel_left_first(shader(shape), shape, buffers.work.is_some());
    record_kernel(recorder, &kernel, shape, buffers)
}

/// Records the tracing of all rays by a kernel that takes [`arguments::Trace`].
pub(super) fn record_kernel(
    recorder: &mut Recorder<'_>,
    kernel: &Kernel,
    shape: &TraceShape,
    buffers: &TraceBuffers,
) -> Result<()> {
    let limits = &recorder.context().limits;
    let subgroup = limits.subgroup_size;
    if shape.loads == Loads::InLongs && !limits.int64 {
        return Err(Error::Argument(
            "loads in elements of 64 bits, without Optional::int64 of the device; enable shaderInt64 and say so, or take Loads::Gathered"
                .into(),
        ));
    }
    let is_one = shape.workgroup == subgroup && subgroup <= Loads::MAX_LANES && limits.subgroup_is_exact;
    if shape.loads == Loads::LaneByLane && !is_one {
        let or_fewer = if limits.subgroup_is_exact { "" } else { " or fewer" };
        return Err(Error::Argument(format!(
            "loads lane by lane in workgroups of {}, subgroups have {subgroup}{or_fewer} lanes; take workgroups of one \
             subgroup of at most {} lanes whose size the device can be held to, or Loads::Gathered",
            shape.workgroup,
            Loads::MAX_LANES
        )));
    }
    let &TraceBuffers { structure, rays, hits, work, count } = buffers;
    if count > MAX_RAYS {
        return Err(Error::Argument(format!(
            "{count} rays in one call, at most {MAX_RAYS}: trace them in several calls"
        )));
    }
    let bytes = |each: usize| u64::from(count) * each as u64;
    let rays = rays.checked("memory of rays", bytes(size_of::<Ray>()), 16)?;
    let hits = hits.checked("memory for hits", bytes(size_of::<Hit>()), 16)?;
    let works = work.map_or(Ok(0), |work| work.checked("memory for work", bytes(size_of::<Work>()), 16))?;
    let rays_each = shape.rays_each_of(count);
    let group_rays = shape.workgroup * rays_each;
    let at_once = recorder.context().limits.workgroup_count.saturating_mul(group_rays);
    let arguments = arguments::Trace {
        structure,
        rays,
        hits,
        works,
        first: 0,
        count,
        rays_each,
        stride: 1,
        start: 0,
        c_t: 0,
        c_i: 0,
        sums: 0,
    };
    let mut first = 0;
    while first < count {
        let arguments = arguments::Trace { first, ..arguments };
        recorder.dispatch(kernel, &arguments, (count - first).min(at_once).div_ceil(group_rays))?;
        first += at_once.min(count - first);
    }
    Ok(())
}
