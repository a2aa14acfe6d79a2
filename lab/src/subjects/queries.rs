//! Rays that are traced as a shader of an engine does it: by queries of `glsl/trace/query.glsl`.

use crate::arguments;
use crate::shaders;
use hedgerow::bvh::layout::MAX_DEPTH;
use hedgerow::gpu::{Context, Kernel, Recorder};
use hedgerow::trace::Query;
use hedgerow::trace::tracer::TraceBuffers;
use serde::{Deserialize, Serialize};

/// What a query has met on its way: nodes of the top level, instances, nodes below, triangles.
pub type QueryWork = [u32; 4];

/// What a ray meets on its way, in the mean.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeanWork {
    /// Nodes of the top level.
    pub top_nodes: f64,
    /// Instances that it enters.
    pub instances: f64,
    /// Nodes below.
    pub nodes_below: f64,
    /// Triangles tested.
    pub tests: f64,
}

impl MeanWork {
    /// The mean over rays.
    pub fn mean(works: &[QueryWork]) -> MeanWork {
        let sum = |k: usize| works.iter().map(|work| f64::from(work[k])).sum::<f64>();
        let [top_nodes, instances, nodes_below, tests] =
            std::array::from_fn(|k| if works.is_empty() { 0.0 } else { sum(k) / works.len() as f64 });
        MeanWork { top_nodes, instances, nodes_below, tests }
    }

    /// All of it together.
    pub fn all(&self) -> f64 {
        self.top_nodes + self.instances + self.nodes_below + self.tests
    }
}

/// How invocations take rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Queries {
    /// One each.
    OneEach,
    /// Many each, in turn (`glsl/trace/query_turns.glsl`). Where tracers have loads lane by lane, so have these in nodes of two and in one
    /// level; through two levels of nodes of eight they have 0.9 of the speed so.
    InTurn,
}

/// The nodes that structures have, as `HEDGEROW_FORMS` (`glsl/trace/query_walk.glsl`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Forms(u32);

impl Forms {
    /// Nodes of two alone.
    pub const OF_TWO: Forms = Forms(1);
    /// Nodes of eight alone.
    pub const OF_EIGHT: Forms = Forms(2);
    /// Both.
    pub const ALL: Forms = Forms(3);

    /// And those of another structure.
    pub(crate) fn with(self, of_eight: bool) -> Forms {
        let others = if of_eight { Forms::OF_EIGHT } else { Forms::OF_TWO };
        Forms(self.0 | others.0)
    }
}

/// What queries are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Queried {
    /// A bottom level, and no top level (`HEDGEROW_ONE_LEVEL`).
    pub(crate) one_level: bool,
    /// What nodes there are.
    pub(crate) forms: Forms,
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
    let (one_level, Forms(forms)) = (u32::from(queried.one_level), queried.forms);
    let lane_by_lane = tuning.lane_by_lane && (queried.one_level || queried.forms == Forms::OF_TWO);
    let shader = match (in_turn, lane_by_lane, tuning.in_longs) {
        (false, _, false) => &shaders::MEASURE_QUERY,
        (false, _, true) => &shaders::MEASURE_QUERY_INT64,
        (true, true, _) => &shaders::MEASURE_QUERY_TURNS_LANES,
        (true, false, false) => &shaders::MEASURE_QUERY_TURNS,
        (true, false, true) => &shaders::MEASURE_QUERY_TURNS_INT64,
    };
    let kernel = match work {
        None => {
            let long_nodes = u32::from(tuning.nodes_in_longs);
            let constants = [any_hit, levels, rays_each, tuning.group, one_level, forms, long_nodes];
            Kernel::new(shader, tuning.group, &constants)
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_the_mean_over_rays() {
        let mean = MeanWork::mean(&[[1, 2, 3, 4], [3, 2, 1, 0]]);
        assert_eq!(mean, MeanWork { top_nodes: 2.0, instances: 2.0, nodes_below: 2.0, tests: 2.0 });
        assert_eq!(MeanWork::mean(&[]).tests, 0.0);
    }
}
