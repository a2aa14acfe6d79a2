//! Rays that are traced as a shader of an engine does it: by queries of `glsl/trace/query.glsl`.

use crate::arguments;
use crate::shaders;
use hedgerow::bvh::layout::MAX_DEPTH;
use hedgerow::gpu::{Kernel, Recorder};
use hedgerow::trace::Query;
use hedgerow::trace::tracer::TraceBuffers;

/// What a query has met on its way: nodes of the top level, instances, nodes below, triangles.
pub type QueryWork = [u32; 4];

/// Records the tracing of rays through a structure of ours, which may have nodes of eight where `wide` says so
/// ([`hedgerow::accel::AccelOptions::wide`]); their [`QueryWork`] is counted where there is room for it.
///
/// # Errors
/// The kernel cannot be made.
pub(crate) fn record(
    recorder: &mut Recorder<'_>,
    query: Query,
    buffers: &TraceBuffers,
    wide: bool,
) -> hedgerow::Result<()> {
    let &TraceBuffers { structure, rays, hits, work, count } = buffers;
    let (rays, hits, works) = (rays.address, hits.address, work.map_or(0, |work| work.address));
    let any_hit = u32::from(query == Query::AnyHit);
    let (tuning, limits) = (&recorder.context().tuning.trace, &recorder.context().limits);
    // As trace::tracer has it, or no level of the stack in shared memory.
    let levels = if tuning.shared_levels >= MAX_DEPTH { 2 * MAX_DEPTH } else { 0 };
    let shader = match (wide, tuning.in_longs) {
        (false, false) => &shaders::MEASURE_QUERY,
        (false, true) => &shaders::MEASURE_QUERY_INT64,
        (true, false) => &shaders::MEASURE_QUERY_QUANTISED,
        (true, true) => &shaders::MEASURE_QUERY_QUANTISED_INT64,
    };
    let kernel = match work {
        None => Kernel::new(shader, tuning.group, &[any_hit, levels]),
        Some(_) => Kernel::new(&shaders::MEASURE_QUERY_WORK, limits.subgroup_size, &[any_hit, 0]),
    };
    let arguments = arguments::TraceQueries { structure, rays, hits, works, first: 0, count };
    recorder.dispatch(&kernel, &arguments, count.div_ceil(kernel.workgroup()))
}
