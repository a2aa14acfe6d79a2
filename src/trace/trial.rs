//! A tree on trial: a changed copy of a tree takes its place if it takes less work for rays that an engine traces anyway.
//!
//! Whatever guesses what a change wins can be wrong. So an engine changes a copy ([`crate::bvh::reinsertion`] by rays), and a part of the
//! *next* frame's rays decides: they are traced in both trees, and the copy is taken if their work is less by more than 1%. If not, the copy
//! becomes what the tree is. Behind a trial both have the same nodes.
//!
//! ```no_run
//! # use hedgerow::{bvh::sah::Collapse, gpu::{Context, Recorder, Region}};
//! # use hedgerow::trace::{Query, counts::CountedRays, trial::{Trial, TrialTrees}};
//! # fn example(context: &Context, recorder: &mut Recorder<'_>, trees: TrialTrees, primitive_count: u32, rays: Region, ray_count: u32)
//! #     -> hedgerow::Result<()> {
//! let trial = Trial::new(context, Collapse::SAH, primitive_count);
//! trial.record_begin(recorder, &trees)?;
//! recorder.barrier();
//! let rays = CountedRays { rays, ray_count, first: 0, stride: 16 };
//! trial.record_rays(recorder, Query::ClosestHit, &rays, &trees)?;
//! recorder.barrier();
//! trial.record_decision(recorder, &trees)?;
//! # Ok(())
//! # }
//! ```

use super::counts::{CountedRays, whole_costs};
use super::tracer::{Loads, TraceShape};
use super::{MAX_RAYS, Query, Ray};
use crate::bvh::layout::{NODES_OFFSET, Node, node_slots};
use crate::bvh::sah::Collapse;
use crate::gpu::{Context, Grid, Kernel, Recorder, Region, arguments, fill, shaders};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};

/// A tree in use and a copy of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrialTrees {
    /// A `Bvh2` of triangles, aligned to 16 bytes.
    pub structure: Region,
    /// A copy of its bytes whose nodes have changed, aligned to 16 bytes. Copies of something else are never taken, and left as they are.
    pub copy: Region,
    /// A [`TrialResult`], aligned to 8 bytes.
    pub result: Region,
}

/// How a trial went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct TrialResult {
    /// Work of the rays in the tree and in the copy: c_T a step and c_I a test, both taken as whole numbers.
    pub work: [u64; 2],
    /// 1: the copy was taken.
    pub is_taken: u32,
    /// Zero.
    pub reserved: u32,
}

/// Puts a copy of a tree in its place if that takes less work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    shape: TraceShape,
    costs: Collapse,
    slots: u32,
    grid: Grid,
}

impl Trial {
    /// For structures of `primitive_count` primitives, by the costs of a step and of a test.
    pub fn new(context: &Context, costs: Collapse, primitive_count: u32) -> Trial {
        let shape = TraceShape { loads: Loads::Gathered, ..TraceShape::of(context) };
        Trial { shape, costs, slots: node_slots(primitive_count), grid: Grid::of(context) }
    }

    /// Records that no ray was traced yet. The caller places a barrier behind.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record_begin(&self, recorder: &mut Recorder<'_>, trees: &TrialTrees) -> Result<()> {
        let [.., result] = self.checked(trees)?;
        fill::record(recorder, result, size_of::<TrialResult>() as u32 / 4, 0)
    }

    /// Records the tracing of every so many rays in both trees, the nearest child first. The trees may be traced by others meanwhile.
    ///
    /// The caller places a barrier before, from what has written rays and trees and from [`Trial::record_begin`], and one behind. Kinds of
    /// rays that come one after the other need none between them.
    ///
    /// # Errors
    /// The stride is 0; more than [`MAX_RAYS`] rays, or than the memory holds; a pipeline could not be made.
    pub fn record_rays(
        &self,
        recorder: &mut Recorder<'_>,
        query: Query,
        rays: &CountedRays,
        trees: &TrialTrees,
    ) -> Result<()> {
        let [structure, copy, result] = self.checked(trees)?;
        let &CountedRays { rays, ray_count, first, stride } = rays;
        if stride == 0 {
            return Err(Error::Argument("a trial by every 0th ray; take a stride of 1 for all rays, or more".into()));
        }
        if ray_count > MAX_RAYS {
            let what = format!("{ray_count} rays of a trial in one call, at most {MAX_RAYS}: take several calls");
            return Err(Error::Argument(what));
        }
        let rays = rays.checked("memory of rays", u64::from(ray_count) * size_of::<Ray>() as u64, 16)?;
        let count = ray_count.saturating_sub(first).div_ceil(stride);
        let [c_t, c_i] = whole_costs(&self.costs);
        let TraceShape { workgroup, shared_levels, .. } = self.shape;
        let constants = [u32::from(query == Query::AnyHit), 0, shared_levels];
        let kernel = Kernel::new(&shaders::TRACE_TRIAL_WORK, workgroup, &constants);
        let rays_each = self.shape.rays_each_of(count);
        let group_rays = workgroup * rays_each;
        let at_once = recorder.context().limits.workgroup_count.saturating_mul(group_rays);
        for (structure, sums) in [(structure, result), (copy, result + 8)] {
            let mut start = 0;
            while start < count {
                let arguments = arguments::Trace {
                    structure,
                    rays,
                    hits: 0,
                    works: 0,
                    first,
                    count,
                    rays_each,
                    stride,
                    start,
                    c_t,
                    c_i,
                    sums,
                };
                recorder.dispatch(&kernel, &arguments, (count - start).min(at_once).div_ceil(group_rays))?;
                start += at_once.min(count - start);
            }
        }
        Ok(())
    }

    /// Records the decision: the copy's nodes become the tree's, or the tree's the copy's. A copy that cannot be traced is never taken.
    ///
    /// The caller places a barrier before and one behind. No ray may be traced in either meanwhile. Label: `trial`.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record_decision(&self, recorder: &mut Recorder<'_>, trees: &TrialTrees) -> Result<()> {
        let [structure, copy, result] = self.checked(trees)?;
        let arguments = arguments::Trial { structure, copy, result };
        recorder.phase("trial");
        recorder.dispatch(&self.grid.kernel(&shaders::TRACE_TRIAL_DECIDE), &arguments, 1)?;
        recorder.barrier();
        recorder.dispatch(&self.grid.kernel(&shaders::TRACE_TRIAL_TAKE), &arguments, self.grid.groups_for(self.slots))
    }

    /// Addresses of tree, copy and result.
    fn checked(&self, trees: &TrialTrees) -> Result<[u64; 3]> {
        let bytes = NODES_OFFSET + size_of::<Node>() as u64 * u64::from(self.slots);
        Ok([
            trees.structure.checked("the BVH on trial", NODES_OFFSET, 16)?,
            trees.copy.checked("the copy of the BVH on trial", bytes.min(trees.structure.bytes), 16)?,
            trees.result.checked("memory for the result of a trial", size_of::<TrialResult>() as u64, 8)?,
        ])
    }
}
