//! Rays that are traced as a shader of an engine does it: by queries of `glsl/trace/query.glsl`.

use crate::arguments;
use crate::shaders;
use hedgerow::bvh::layout::MAX_DEPTH;
use hedgerow::gpu::{Context, Kernel, Recorder};
use hedgerow::trace::Query;
use hedgerow::trace::tracer::TraceBuffers;

/// What a query has met on its way: nodes of the top level, instances, nodes below, triangles.
pub type QueryWork = [u32; 4];

/// How invocations take rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Queries {
    /// One each.
    OneEach,
    /// Many each, in turn (`glsl/trace/query_turns.glsl`), with loads lane by lane where tracers have them.
    InTurn,
}

/// What queries are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Queried {
    /// A top level and what is below it.
    TwoLevels {
        /// They may have nodes of eight ([`hedgerow::accel::AccelOptions::wide`]).
        wide: bool,
    },
    /// A bottom level of nodes of two, and no top level (`HEDGEROW_ONE_LEVEL`).
    OneLevel,
}

/// Records the tracing of rays through a structure of ours; their [`QueryWork`] is counted, by one each, where there is room for it.
///
/// # Errors
/// The kernel cannot be made.
pub(crate) fn record(
    recorder: &mut Recorder<'_>,
    query: Query,
    buffers: &TraceBuffers,
    queried: Queried,
    queries: Queries,
) -> hedgerow::Result<()> {
    let &TraceBuffers { structure, rays, hits, work, count } = buffers;
    let (rays, hits, works) = (rays.address, hits.address, work.map_or(0, |work| work.address));
    let any_hit = u32::from(query == Query::AnyHit);
    let (tuning, limits) = (&recorder.context().tuning.trace, &recorder.context().limits);
    // As trace::tracer has it, or no level of the stack in shared memory.
    let levels = if tuning.shared_levels >= MAX_DEPTH { 2 * MAX_DEPTH } else { 0 };
    let in_turn = queries == Queries::InTurn && work.is_none();
    let rays_each = if in_turn { rays_in_turn(recorder.context(), count) } else { 1 };
    let is_wide = queried == Queried::TwoLevels { wide: true };
    let one_level = u32::from(queried == Queried::OneLevel);
    let shader = match (in_turn, is_wide, tuning.in_longs) {
        (true, false, _) if tuning.lane_by_lane => &shaders::MEASURE_QUERY_TURNS_LANES,
        (false, false, false) => &shaders::MEASURE_QUERY,
        (false, false, true) => &shaders::MEASURE_QUERY_INT64,
        (false, true, false) => &shaders::MEASURE_QUERY_QUANTISED,
        (false, true, true) => &shaders::MEASURE_QUERY_QUANTISED_INT64,
        (true, false, false) => &shaders::MEASURE_QUERY_TURNS,
        (true, false, true) => &shaders::MEASURE_QUERY_TURNS_INT64,
        (true, true, false) => &shaders::MEASURE_QUERY_QUANTISED_TURNS,
        (true, true, true) => &shaders::MEASURE_QUERY_QUANTISED_TURNS_INT64,
    };
    let kernel = match work {
        None => Kernel::new(shader, tuning.group, &[any_hit, levels, rays_each, tuning.group, one_level]),
        Some(_) => Kernel::new(&shaders::MEASURE_QUERY_WORK, limits.subgroup_size, &[any_hit, 0]),
    };
    let arguments = arguments::TraceQueries { structure, rays, hits, works, first: 0, count };
    recorder.dispatch(&kernel, &arguments, count.div_ceil(kernel.workgroup() * rays_each))
}

/// Rays of an invocation where there are `count`: eight workgroups for each core of the host, whose CPU the device is where its tuning
/// gives an invocation more than one.
fn rays_in_turn(context: &Context, count: u32) -> u32 {
    let tuning = &context.tuning.trace;
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get() as u32);
    (count / (tuning.group * 8 * cores)).clamp(1, tuning.rays_each)
}
