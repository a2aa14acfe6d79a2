//! Parallel reinsertion on the device: subtrees of a finished tree move to where they cost less.
//!
//! Meister and Bittner 2018, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization". A *link* names a subtree by where
//! it hangs: 2 · slot + side. To move the subtree at a link, its parent is taken out (the sibling takes its place) and put in
//! again at another link, with the subtree still below it: nothing moves in memory but boxes and indices. The *pivot* is the
//! lowest node above both places; above it no box changes. Children of the root stay, so the root does.
//!
//! A round has three steps, each done for all links at once that the round tries:
//!
//! 1. *search*: of the subtree at each link, the move that shortens the sum of the nodes' areas most: up through ten pivots (all of
//!    them, in the paper), and down on their other side as long as there may be more to gain than was found, into at most 32 nodes;
//! 2. *match*: a move is made if no other across a node of its path (from the parent up to the pivot, and from there down to
//!    the new place) gains more, or as much with a smaller link;
//! 3. *move*: of each such path, the links, boxes and parents.
//!
//! Paths of moves that are made have no node in common. That is the paper's conservative locking: gains add up, no cycle can
//! come to be, and the area never grows. It lets fewer moves through than locking only the nodes whose links change. That is
//! made up for by trying few links a round and more rounds ([`ReinsertionOptions::stride`]): what was tried, with figures, is
//! in docs/notes/optimisation.md.
//!
//! What a node costs may be its area alone, or a mixture with the rays of a sample that meet its box ([`Cost::Rays`]): what rays have done
//! lately is a better guess of the next frame than areas are. An engine records a few rounds a frame on a copy of the tree in use, and
//! [`crate::trace::trial`] takes the copy where it takes less work. [`Reinsertion::record_probe`] asks what rounds would win, and moves
//! nothing. docs/reinsertion.md has the whole way.
//!
//! The leaves of the tree that a builder optimises have one record each; collapsing comes behind it and makes leaves of whatever is deeper than tracers can
//! walk. In a tree that is finished, leaves move as they are. The twins are [`Bvh2::reinserted`](super::layout::Bvh2::reinserted) and
//! [`Bvh2::reinserted_by`](super::layout::Bvh2::reinserted_by): the same bytes.

use super::codes::CodeBounds;
use super::flux::GRID_BYTES;
use super::layout::{NODES_OFFSET, node_slots};
use crate::gpu::arguments;
use crate::gpu::{Context, Grid, Kernel, Recorder, Region, Step, fill, shaders};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use std::time::Duration;

/// How much is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ReinsertionOptions {
    /// How many rounds there are. Time grows with them.
    pub rounds: u32,
    /// Of so many links, one is tried in a round, another in each: so many rounds are a *pass*. Where there are few links both
    /// numbers are smaller by the same factor.
    pub stride: u32,
}

impl ReinsertionOptions {
    /// Every link once: most of the gain for a good tree.
    pub const FAST: ReinsertionOptions = ReinsertionOptions::of_passes(1);
    /// Every link twice.
    pub const MEDIUM: ReinsertionOptions = ReinsertionOptions::of_passes(2);
    /// Every link six times: more rounds gain little.
    pub const HIGH: ReinsertionOptions = ReinsertionOptions::of_passes(6);
    /// A sixteenth of all links: what a probe looks at.
    pub const PROBE: ReinsertionOptions = ReinsertionOptions { rounds: 4, stride: STRIDE };

    /// So many passes, of 64 rounds each where there are enough links.
    pub const fn of_passes(passes: u32) -> ReinsertionOptions {
        ReinsertionOptions { rounds: passes.saturating_mul(STRIDE), stride: STRIDE }
    }

    /// As many rounds as there is time for in `budget`, if a pass over the same structure takes `pass`: what
    /// [`ReinsertionOptions::FAST`] took. Rounds of [`ReinsertionOptions::HIGH`] at most, and possibly none.
    pub fn within(budget: Duration, pass: Duration) -> ReinsertionOptions {
        // A ratio of floats; if it is not a number, nothing is gained.
        let rounds = f64::from(STRIDE) * budget.as_secs_f64() / pass.as_secs_f64();
        ReinsertionOptions { rounds: (rounds as u32).min(ReinsertionOptions::HIGH.rounds), stride: STRIDE }
    }

    /// The stride between links that are tried in one round of a structure with these node slots: at least [`LEAST_LINKS`] a round.
    pub(super) fn stride_for(&self, node_slots: u32) -> u32 {
        self.stride.min(2 * node_slots / LEAST_LINKS).max(1)
    }

    /// Rounds for a structure with these node slots.
    pub(super) fn rounds_for(&self, node_slots: u32) -> u32 {
        let rounds = u64::from(self.rounds) * u64::from(self.stride_for(node_slots));
        u32::try_from(rounds.div_ceil(u64::from(self.stride.max(1)))).unwrap_or(u32::MAX)
    }
}

/// What the node with a box costs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cost {
    /// Its area.
    Area,
    /// Partly the rays that meet it.
    Rays {
        /// A grid that [`crate::trace::flux::FluxPass`] has filled, over the box of the same scene. Without rays in it the cost is the area.
        grid: Region,
        /// Which part of the whole tree's cost is by rays when rounds begin, from 0 to [`Cost::MOST`]. The rest is by area.
        share: f32,
    },
}

impl Cost {
    /// A share of rays with which the next frame's rays took least work: docs/notes/reinsertion_by_rays.md.
    pub const SHARE: f32 = 0.9;
    /// The largest share. Boxes that no ray has met must not be free.
    pub const MOST: f32 = 0.99;

    /// Address of the grid, or 0, and what rays weigh in the whole tree's cost, the area being 1.
    fn checked(&self) -> Result<(u64, f32)> {
        match *self {
            Cost::Area => Ok((0, 0.0)),
            Cost::Rays { grid, share } => {
                Ok((grid.checked("a grid of rays that teach reinsertion", GRID_BYTES, 16)?, weight_of(share)?))
            }
        }
    }
}

/// What rays weigh in the whole tree's cost, its area being 1.
///
/// # Errors
/// The share is not from 0 to [`Cost::MOST`].
pub(super) fn weight_of(share: f32) -> Result<f32> {
    if (0.0..=Cost::MOST).contains(&share) {
        return Ok(share / (1.0 - share));
    }
    let most = Cost::MOST;
    Err(Error::Argument(format!("a share of {share} by rays; take one from 0, which is by area, to {most}")))
}

/// What a search without moves has found.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Probed {
    /// What the best moves gain, each for itself: scaled half areas of nodes, in parts of 2⁻³².
    pub gains: u64,
    /// Links that were looked at.
    pub tried: u32,
    /// Scaled half area of the root.
    pub root_area: f32,
}

impl Probed {
    /// What moves of all links of a tree with these node slots would gain, over the root's area; 0 of a tree without links. Moves stand in
    /// each other's way: it is a measure of what a pass wins, and not in the same unit.
    pub fn relative_gain(&self, node_slots: u32) -> f64 {
        let parts = f64::from(self.tried) * f64::from(self.root_area) * 4_294_967_296.0;
        if parts > 0.0 { self.gains as f64 * 2.0 * f64::from(node_slots) / parts } else { 0.0 }
    }
}

/// Of [`ReinsertionOptions::of_passes`].
const STRIDE: u32 = 64;
/// Links that are not worth a round of less.
const LEAST_LINKS: u32 = 128;
/// Subtrees that a search may put off; what does not find room is not looked at.
pub(super) const STACK: usize = 32;
/// Pivots of a search, at most.
pub(super) const LEVELS: usize = 10;
/// Nodes that a search looks into below them, at most.
pub(super) const VISITS: u32 = 32;
/// A gain counts if it is more than this share of the pivot's area: less may be rounding.
pub(super) const LEAST_SHARE: f32 = 1.0 / 1_048_576.0;
/// And more than this, the scene's longest edge being about 1: less may be made of numbers that devices take for zero.
pub(super) const LEAST_GAIN: f32 = 1.0 / 1_152_921_504_606_846_976.0;
/// And as this at most: a round's gains take 30 bits of a word.
pub(super) const MOST_GAIN: f32 = f32::from_bits(LEAST_GAIN.to_bits() + (1 << 30) - 1);
/// Rounds until what moves gain and which are first are zeros again: as many as the rest of the word tells apart.
const ROUNDS_A_FILL: u32 = 4;

/// Bytes of `Move` in reinsertion.glsl.
const MOVE_BYTES: u64 = 12;
/// Of two sums and a ratio by rays; a multiple of 16.
const TOTALS_BYTES: u64 = 32;
/// Bytes of an entry of a search's stack, `Below` in glsl/bvh/reinsertion/search.glsl.
const ENTRY_BYTES: u32 = 8;

/// Rounds of reinsertion, for one device and a number of primitives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reinsertion {
    slots: u32,
    stride: u32,
    rounds: u32,
    first_round: u32,
    grid: Grid,
    shared: u32,
    /// The invocations of the one workgroup that does all rounds of a build, if there is one.
    alone_group: Option<u32>,
}

impl Reinsertion {
    /// For structures of `primitive_count` primitives.
    pub fn new(context: &Context, options: &ReinsertionOptions, primitive_count: u32) -> Reinsertion {
        let tuning = &context.tuning;
        // As many invocations as the grid has, in workgroups small enough for their stacks.
        let groups = tuning.grid.groups * (tuning.grid.workgroup / tuning.small_group).max(1);
        let groups = groups.min(context.limits.workgroup_count);
        let rounds = tuning.build.reinsertion_rounds;
        let grid = Grid { workgroup: tuning.small_group, groups, rounds, ..tuning.grid };
        let bytes = ENTRY_BYTES * tuning.small_group;
        let shared = tuning.build.reinsertion_shared.min(context.limits.shared_memory / bytes).min(STACK as u32);
        let slots = node_slots(primitive_count);
        let (stride, rounds) = (options.stride_for(slots), options.rounds_for(slots));
        Reinsertion { slots, stride, rounds, first_round: 0, grid, shared, alone_group: None }
    }

    /// The same from another round on: where a pass goes over many frames, the number of rounds that there were.
    pub fn from_round(self, first_round: u32) -> Reinsertion {
        Reinsertion { first_round: first_round % self.stride, ..self }
    }

    /// The same in one dispatch of a workgroup, as part of a build.
    pub(super) fn alone(self, context: &Context) -> Reinsertion {
        let group = context.tuning.build.alone_group;
        let shared = self.shared.min(context.limits.shared_memory / (ENTRY_BYTES * group));
        Reinsertion { alone_group: Some(group), shared, ..self }
    }

    /// Whether one workgroup does all rounds of a build.
    pub(super) fn is_alone(&self) -> bool {
        self.alone_group.is_some()
    }

    /// How many rounds are recorded: those of the options, and fewer where there are few links.
    pub fn rounds(&self) -> u32 {
        self.rounds
    }

    fn link_count(&self) -> u32 {
        2 * self.slots
    }

    /// Bytes of scratch memory: no fewer than for a smaller structure, whose rounds may try more links.
    pub fn scratch_bytes(&self) -> u64 {
        let moves = self.link_count().div_ceil(self.stride).max(self.link_count().min(2 * LEAST_LINKS));
        12 * u64::from(self.slots) + MOVE_BYTES * u64::from(moves)
    }

    /// Bytes of scratch memory by rays: 8 for each node slot more.
    pub fn scratch_bytes_by_rays(&self) -> u64 {
        self.scratch_bytes() + 4 * u64::from(self.link_count()) + TOTALS_BYTES
    }

    fn scratch_bytes_for(&self, cost: &Cost) -> u64 {
        if *cost == Cost::Area { self.scratch_bytes() } else { self.scratch_bytes_by_rays() }
    }

    fn kernel(&self, shader: &'static shaders::Shader, by_rays: bool, areas: Areas) -> Kernel {
        Kernel::new(shader, self.grid.workgroup, &[self.grid.word(), self.shared, by_rays.into(), areas as u32])
    }

    /// Records all rounds on `structure`, in place, with scratch memory of [`Reinsertion::scratch_bytes`]; both aligned
    /// to 16 bytes. Four dispatches a round, and one more in every fourth, with barriers between; the caller places one before and one
    /// behind. Label: `optimise`.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, structure: Region, scratch: Region) -> Result<()> {
        let structure = structure.checked("the BVH to optimise", NODES_OFFSET, 16)?;
        let scratch = scratch.checked("scratch memory of an optimisation", self.scratch_bytes(), 16)?;
        recorder.chains(&[self.steps(structure, scratch, (Areas::Whole, 0))])
    }

    /// Records all rounds on a finished tree, in place, with scratch memory of [`Reinsertion::scratch_bytes`], or of
    /// [`Reinsertion::scratch_bytes_by_rays`] by [`Cost::Rays`]; all aligned to 16 bytes. The structure has as many primitives as was planned
    /// for. No ray may be traced in it meanwhile.
    ///
    /// Nodes change and records do not. An order of children is lost, and the header says so. Its SAH cost stays as it was: a refit sets it.
    /// A tree that becomes deeper than tracers can walk has the status [`TOO_DEEP`](super::layout::status::TOO_DEEP) and is traced as if it
    /// were empty. So rounds go to a copy, which [`crate::trace::trial`] may refuse.
    ///
    /// Four dispatches a round, and one more in every fourth, with barriers between; the caller places one before and one behind.
    /// Label: `optimise`.
    ///
    /// # Errors
    /// The memory is too small; the share is out of range; a pipeline could not be made.
    pub fn record_rounds(
        &self,
        recorder: &mut Recorder<'_>,
        structure: Region,
        cost: &Cost,
        scratch: Region,
    ) -> Result<()> {
        let structure = structure.checked("the BVH to optimise", NODES_OFFSET, 16)?;
        let scratch = scratch.checked("scratch memory of an optimisation", self.scratch_bytes_for(cost), 16)?;
        let run = self.run(structure, scratch, cost)?;
        let rounds = (0..self.rounds).flat_map(|round| run.round(round));
        let depths = run.step(&shaders::BVH_REINSERTION_DEPTHS, 0, self.slots);
        recorder.chains(&[run.begin().into_iter().chain(rounds).chain([depths]).collect()])
    }

    /// Records a search that moves nothing, with scratch memory as of [`Reinsertion::record_rounds`]. It writes what it has found to
    /// `found`, a [`Probed`] aligned to 8 bytes. [`ReinsertionOptions::PROBE`] looks at enough links: a sum over fewer does not say what a
    /// pass would win.
    ///
    /// Two dispatches a round with barriers between; the caller places one before and one behind. Label: `probe`.
    ///
    /// # Errors
    /// As [`Reinsertion::record_rounds`].
    pub fn record_probe(
        &self,
        recorder: &mut Recorder<'_>,
        structure: Region,
        cost: &Cost,
        scratch: Region,
        found: Region,
    ) -> Result<()> {
        let structure = structure.checked("the BVH to probe", NODES_OFFSET, 16)?;
        let scratch = scratch.checked("scratch memory of a probe", self.scratch_bytes_for(cost), 16)?;
        let sums = found.checked("memory for what a probe finds", size_of::<Probed>() as u64, 8)?;
        let run = Run { phase: "probe", sums, ..self.run(structure, scratch, cost)? };
        let clear = fill::step(run.phase, sums, size_of::<Probed>() as u32 / 4, 0);
        let offsets = self.probed_offsets();
        let looks = offsets.flat_map(|offset| {
            [&shaders::BVH_REINSERTION_SEARCH, &shaders::BVH_REINSERTION_GAINS]
                .map(|shader| run.step(shader, offset, run.tried()))
        });
        recorder.chains(&[[clear].into_iter().chain(run.begin()).chain(looks).collect()])
    }

    /// The first links of the rounds of a probe.
    fn probed_offsets(&self) -> impl Iterator<Item = u32> + use<> {
        probed_offsets(self.rounds, self.stride)
    }

    /// What [`Reinsertion::record`] records, with addresses that were checked, by these areas with the box of the part at an address.
    pub(super) fn steps(&self, structure: u64, scratch: u64, (areas, part): (Areas, u64)) -> Vec<Step> {
        let run = self.run(structure, scratch, &Cost::Area).expect("areas have nothing to check");
        let run = Run { areas, part, ..run };
        if let Some(workgroup) = self.alone_group {
            let of_group = Reinsertion { grid: Grid { workgroup, ..self.grid }, ..*self };
            let kernel = of_group.kernel(&shaders::BVH_REINSERTION_ALONE, false, areas);
            return vec![Step::new(run.phase, kernel, &run.arguments(self.first_round), 1)];
        }
        run.begin().into_iter().chain((0..self.rounds).flat_map(|round| run.round(round))).collect()
    }

    fn run(&self, structure: u64, scratch: u64, cost: &Cost) -> Result<Run> {
        let (grid, by_rays) = cost.checked()?;
        Ok(Run {
            of: *self,
            phase: "optimise",
            structure,
            scratch,
            grid,
            by_rays,
            sums: 0,
            areas: Areas::Whole,
            part: 0,
        })
    }
}

/// What the area of a node is, where most rays are in a part of the scene: `AREAS` in glsl/bvh/reinsertion.glsl.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Areas {
    /// Its own.
    Whole,
    /// That of what it shares with the part.
    Clipped,
    /// Its own within the part, none outside; of a node that is in both, the part's: boxes in it are coarse when it is quantised.
    Coarse,
}

impl Areas {
    /// Of a top level by these codes: rays are where most instances are, and a tree by the areas of what is far would cost them.
    pub(super) fn of_instances(bounds: CodeBounds) -> Areas {
        match bounds {
            CodeBounds::Robust => Areas::Clipped,
            CodeBounds::Apart => Areas::Coarse,
            CodeBounds::Full | CodeBounds::Concise | CodeBounds::Centroid => Areas::Whole,
        }
    }
}

/// The first links of the rounds of a probe: spread over all, left and right children.
pub(super) fn probed_offsets(rounds: u32, stride: u32) -> impl Iterator<Item = u32> {
    (0..rounds.min(stride)).map(move |k| 17 * k % stride)
}

/// Steps on a structure, with addresses that were checked.
struct Run {
    of: Reinsertion,
    phase: &'static str,
    structure: u64,
    scratch: u64,
    grid: u64,
    by_rays: f32,
    sums: u64,
    areas: Areas,
    part: u64,
}

impl Run {
    fn arguments(&self, offset: u32) -> arguments::Reinsertion {
        let Run { of, structure, scratch, grid, by_rays, sums, part, .. } = *self;
        let words = 4 * u64::from(of.slots);
        let behind = scratch + of.scratch_bytes();
        arguments::Reinsertion {
            structure,
            parents: scratch,
            gains: scratch + words,
            firsts: scratch + 2 * words,
            moves: scratch + 3 * words,
            grid,
            costs: behind + TOTALS_BYTES,
            totals: behind,
            sums,
            part,
            offset,
            stride: of.stride,
            since_fill: 0,
            rounds: of.rounds,
            link_count: of.link_count(),
            by_rays,
        }
    }

    fn step(&self, shader: &'static shaders::Shader, offset: u32, items: u32) -> Step {
        self.step_with(shader, &self.arguments(offset), items)
    }

    fn step_with(&self, shader: &'static shaders::Shader, arguments: &arguments::Reinsertion, items: u32) -> Step {
        let kernel = self.of.kernel(shader, self.grid != 0, self.areas);
        Step::new(self.phase, kernel, arguments, self.of.grid.groups_for(items))
    }

    /// How many links a round tries.
    fn tried(&self) -> u32 {
        self.of.link_count().div_ceil(self.of.stride)
    }

    /// What comes before all rounds.
    fn begin(&self) -> Vec<Step> {
        let slots = self.of.slots;
        let mut steps = vec![self.step(&shaders::BVH_REINSERTION_PARENTS, 0, slots)];
        if self.grid != 0 {
            let totals = self.arguments(0).totals;
            steps.push(fill::step(self.phase, totals, (TOTALS_BYTES / 4) as u32, 0));
            steps.push(self.step(&shaders::BVH_REINSERTION_TOTALS, 0, slots));
            steps.push(self.step(&shaders::BVH_REINSERTION_LINKS, 0, 2 * slots));
        }
        steps
    }

    fn round(&self, round: u32) -> impl Iterator<Item = Step> {
        let offset = (self.of.first_round + round) % self.of.stride;
        let since_fill = round % ROUNDS_A_FILL;
        let arguments = arguments::Reinsertion { since_fill, ..self.arguments(offset) };
        let fills = (since_fill == 0).then(|| fill::step(self.phase, arguments.gains, 2 * self.of.slots, 0));
        fills.into_iter().chain(STEPS.map(|shader| self.step_with(shader, &arguments, self.tried())))
    }
}

const STEPS: [&shaders::Shader; 4] = [
    &shaders::BVH_REINSERTION_SEARCH,
    &shaders::BVH_REINSERTION_MATCH,
    &shaders::BVH_REINSERTION_SETTLE,
    &shaders::BVH_REINSERTION_MOVE,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_has_the_rounds_that_there_is_time_for() {
        let within = |budget, pass| {
            ReinsertionOptions::within(Duration::from_millis(budget), Duration::from_millis(pass)).rounds
        };
        assert_eq!((within(50, 100), within(101, 100), within(1, 100)), (32, 64, 0));
        assert_eq!(within(10_000, 100), ReinsertionOptions::HIGH.rounds);
        // Where a pass is shorter than the clock's tick.
        assert_eq!((within(0, 0), within(1, 0)), (0, ReinsertionOptions::HIGH.rounds));
    }

    #[test]
    fn a_pass_of_few_links_has_fewer_rounds() {
        let slots = 640;
        assert_eq!((ReinsertionOptions::FAST.stride_for(slots), ReinsertionOptions::FAST.rounds_for(slots)), (10, 10));
        assert_eq!(ReinsertionOptions { rounds: 32, stride: 64 }.rounds_for(slots), 5);
        assert_eq!(ReinsertionOptions { rounds: 33, stride: 64 }.rounds_for(slots), 6);
        assert_eq!(ReinsertionOptions::of_passes(u32::MAX).rounds_for(2), u32::MAX / 64 + 1);
    }
}
