//! What rays do in a `Bvh2`, counted by its links on the device: what orders of children, wide nodes and reinsertion learn from.
//!
//! An engine counts a part of a frame's rays, another one each frame: every `stride`-th, from `first` on. [`CountPass::record_rays`] adds
//! to tallies, as often as there are kinds of rays; [`CountPass::record_gather`] makes [`LinkCount`]s of them. Of what was counted
//! before, it keeps all, half or nothing. What is counted is whole numbers that are added: the same for every device, subgroup size and
//! order of rays. [`super::twin::counts`] counts the same on the host.
//!
//! ```no_run
//! # use hedgerow::{bvh::sah::Collapse, gpu::{Context, Recorder, Region}};
//! # use hedgerow::trace::{Query, counts::{CountPass, CountedRays, CountedWalk, Earlier, Tallies}};
//! # fn example(context: &Context, recorder: &mut Recorder<'_>, structure: Region, primitive_count: u32, rays: Region, ray_count: u32,
//! #            frame: u32, memory: [Region; 3]) -> hedgerow::Result<()> {
//! let [tallies, counts, scratch] = memory;
//! let pass = CountPass::new(context, Collapse::SAH, primitive_count);
//! let tallies = Tallies { structure, tallies };
//! // Once, before the first frame:
//! pass.record_clear(recorder, &tallies)?;
//! recorder.barrier();
//! // A sixteenth of each frame's rays:
//! let rays = CountedRays { rays, ray_count, first: frame % 16, stride: 16 };
//! pass.record_rays(recorder, CountedWalk::AsTraced(Query::ClosestHit), &rays, &tallies)?;
//! recorder.barrier();
//! // Every few frames:
//! pass.record_gather(recorder, &tallies, counts, scratch, Earlier::Halved)?;
//! # Ok(())
//! # }
//! ```

use super::tracer::{Loads, TraceShape};
use super::{MAX_RAYS, Query, Ray};
use crate::bvh::child_order;
use crate::bvh::counts::LinkCount;
use crate::bvh::layout::{NODES_OFFSET, node_slots};
use crate::bvh::sah::Collapse;
use crate::gpu::{Context, Kernel, Recorder, Region, arguments, fill, shaders};
use crate::{Error, Result};

/// Where a ray that is counted goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CountedWalk {
    /// Where the tracer takes it, the nearest child first: for wide nodes and for reinsertion. Of rays to the closest hit, hits are those
    /// that were nearer than what was hit before.
    AsTraced(Query),
    /// Through all that it meets between its limits, whatever it hits: for orders of children, which must not depend on the present one.
    Exhaustive,
}

/// What becomes of what was counted before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Earlier {
    /// All of it stays. Sums that have no room in 32 bits stay at the largest number that has.
    Kept,
    /// Half of it stays, rounded down: what is counted now weighs as much as all that was before.
    Halved,
    /// Nothing stays; the memory need not have been written.
    Dropped,
}

/// Which rays are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CountedRays {
    /// [`Ray`] × `ray_count`, aligned to 16 bytes.
    pub rays: Region,
    /// How many there are, at most [`MAX_RAYS`].
    pub ray_count: u32,
    /// The first that is counted.
    pub first: u32,
    /// From one that is counted to the next, 1 or more.
    pub stride: u32,
}

/// The structure and what is tallied of rays in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tallies {
    /// A `Bvh2` of triangles, aligned to 16 bytes.
    pub structure: Region,
    /// [`CountPass::tally_bytes`], aligned to 4 bytes.
    pub tallies: Region,
}

/// Counts rays by the links of a `Bvh2`.
///
/// A structure of more primitives than was planned for must not be given to [`CountPass::record_rays`]. One that cannot be traced, or whose
/// root is a leaf, has no links: nothing is counted. Between two [`CountPass::record_gather`] at most 2³² − 1 rays may be counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CountPass {
    shape: TraceShape,
    costs: Collapse,
    slots: u32,
    workgroup: u32,
    rounds: u32,
}

/// Words of the tally of a node in glsl/trace/counts.glsl.
const TALLY_WORDS: u64 = 5;

impl CountPass {
    /// For structures of at most `primitive_count` primitives. The costs of a step and of a test are taken as whole numbers; whether the
    /// tree was collapsed means nothing here.
    pub fn new(context: &Context, costs: Collapse, primitive_count: u32) -> CountPass {
        let shape = TraceShape { loads: Loads::Gathered, ..TraceShape::of(context) };
        let (workgroup, rounds) = (context.tuning.group, context.tuning.measure_rounds);
        CountPass { shape, costs, slots: node_slots(primitive_count), workgroup, rounds }
    }

    /// Bytes of tallies: 20 for each node slot.
    pub fn tally_bytes(&self) -> u64 {
        4 * TALLY_WORDS * u64::from(self.slots)
    }

    /// Bytes of counts: two [`LinkCount`] for each node slot, link by link.
    pub fn counts_bytes(&self) -> u64 {
        2 * size_of::<LinkCount>() as u64 * u64::from(self.slots)
    }

    /// Bytes of scratch memory for gathering: 16 for each node slot.
    pub fn scratch_bytes(&self) -> u64 {
        16 * u64::from(self.slots)
    }

    /// Records that tallies begin from nothing. Gathering leaves them so, too.
    ///
    /// The caller places a barrier between this and what is recorded next.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record_clear(&self, recorder: &mut Recorder<'_>, tallies: &Tallies) -> Result<()> {
        let words = self.checked(tallies)?.1;
        fill::record(recorder, words, (self.tally_bytes() / 4) as u32, 0)
    }

    /// Records the counting of rays. The same structure is traced by others meanwhile, if they like.
    ///
    /// The caller places a barrier before, from what has written rays and structure and from clearing, and one behind. Kinds of rays
    /// that are counted one after the other need none between them.
    ///
    /// # Errors
    /// The stride is 0; more than [`MAX_RAYS`] rays, or than the memory holds; a pipeline could not be made.
    pub fn record_rays(
        &self,
        recorder: &mut Recorder<'_>,
        walk: CountedWalk,
        rays: &CountedRays,
        tallies: &Tallies,
    ) -> Result<()> {
        let (structure, tallies) = self.checked(tallies)?;
        let &CountedRays { rays, ray_count, first, stride } = rays;
        if stride == 0 {
            let what = "counting every 0th ray of a sample; take a stride of 1 for all rays, or more for a part";
            return Err(Error::Argument(what.into()));
        }
        if ray_count > MAX_RAYS {
            let what =
                format!("{ray_count} rays to count in one call, at most {MAX_RAYS}: count them in several calls");
            return Err(Error::Argument(what));
        }
        let rays = rays.checked("memory of rays", u64::from(ray_count) * size_of::<Ray>() as u64, 16)?;
        let count = ray_count.saturating_sub(first).div_ceil(stride);
        let walk = match walk {
            CountedWalk::AsTraced(Query::ClosestHit) => 0,
            CountedWalk::AsTraced(Query::AnyHit) => 1,
            CountedWalk::Exhaustive => 2,
        };
        let TraceShape { workgroup, shared_levels, .. } = self.shape;
        let kernel = Kernel::new(&shaders::TRACE_COUNTS_RAYS, workgroup, &[walk, 0, shared_levels]);
        let rays_each = self.shape.rays_each_of(count);
        let group_rays = workgroup * rays_each;
        let at_once = recorder.context().limits.workgroup_count.saturating_mul(group_rays);
        let mut begin = 0;
        while begin < count {
            let arguments = arguments::CountRays { structure, rays, tallies, first, stride, begin, count, rays_each };
            recorder.dispatch(&kernel, &arguments, (count - begin).min(at_once).div_ceil(group_rays))?;
            begin += at_once.min(count - begin);
        }
        Ok(())
    }

    /// Records that tallies become counts: of [`CountPass::counts_bytes`], aligned to 4 bytes, with scratch memory of
    /// [`CountPass::scratch_bytes`], aligned to 8. Those of nodes behind the structure's own are not written. In a structure that has no
    /// links, or more primitives than was planned for, nothing is counted: what was before is kept, halved or dropped.
    ///
    /// A subtree's work is that of all rays that went into its links, `c_T` a node and `c_I` a primitive of a leaf, whether or not a ray
    /// has ended before it met all of them.
    ///
    /// The caller places a barrier before and behind.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record_gather(
        &self,
        recorder: &mut Recorder<'_>,
        tallies: &Tallies,
        counts: Region,
        scratch: Region,
        earlier: Earlier,
    ) -> Result<()> {
        let (structure, tallies) = self.checked(tallies)?;
        let counts = counts.checked("memory for counts of rays", self.counts_bytes(), 4)?;
        let scratch = scratch.checked("scratch memory for counts of rays", self.scratch_bytes(), 8)?;
        let slots = u64::from(self.slots);
        let (parents, waits) = (scratch + 8 * slots, scratch + 12 * slots);
        let [c_t, c_i] = whole_costs(&self.costs);
        let halvings = match earlier {
            Earlier::Kept => 0,
            Earlier::Halved => 1,
            Earlier::Dropped => 32,
        };
        let (slots, rounds) = (self.slots, self.rounds);
        let arguments = arguments::GatherCounts {
            structure,
            tallies,
            counts,
            parents,
            waits,
            totals: scratch,
            slots,
            rounds,
            c_t,
            c_i,
            halvings,
        };
        let groups = slots.div_ceil(self.workgroup * rounds);
        let climb = arguments::ChildOrder {
            structure,
            parents,
            waits,
            weights: 0,
            counts: 0,
            slots,
            rounds,
            c_t: 0.0,
            c_i: 0.0,
        };
        recorder.dispatch(&child_order::parents_kernel(self.workgroup), &climb, groups)?;
        recorder.barrier();
        recorder.dispatch(&Kernel::new(&shaders::TRACE_COUNTS_GATHER, self.workgroup, &[]), &arguments, groups)
    }

    /// Addresses of the structure and of the tallies.
    fn checked(&self, tallies: &Tallies) -> Result<(u64, u64)> {
        let structure = tallies.structure.checked("the BVH in which rays are counted", NODES_OFFSET, 16)?;
        Ok((structure, tallies.tallies.checked("memory for tallies of rays", self.tally_bytes(), 4)?))
    }
}

/// What a step and a test cost, in the whole numbers in which work is counted.
pub(super) fn whole_costs(costs: &Collapse) -> [u32; 2] {
    [costs.c_t, costs.c_i].map(|cost| cost.round() as u32)
}
