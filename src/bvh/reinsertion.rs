//! Parallel reinsertion on the device: subtrees of a finished tree move to where they cost less.
//!
//! Meister and Bittner 2018, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization". A *link* names a subtree by where
//! it hangs: 2 · slot + side. To move the subtree at a link, its parent is taken out (the sibling takes its place) and put in
//! again at another link, with the subtree still below it: nothing moves in memory but boxes and indices. The *pivot* is the
//! lowest node above both places; above it no box changes. Children of the root stay, so the root does.
//!
//! A round has three steps, each done for all links at once that the round tries:
//!
//! 1. *search*: of the subtree at each link, the move that shortens the sum of the nodes' areas most: up through all pivots, and
//!    down on their other side as long as there may be more to gain than was found;
//! 2. *match*: a move is made if no other across a node of its path (from the parent up to the pivot, and from there down to
//!    the new place) gains more, or as much with a smaller link;
//! 3. *move*: of each such path, the links, boxes and parents.
//!
//! Paths of moves that are made have no node in common. That is the paper's conservative locking: gains add up, no cycle can
//! come to be, and the area never grows. It lets fewer moves through than locking only the nodes whose links change. That is
//! made up for by trying few links a round and more rounds ([`ReinsertionOptions::stride`]): what was tried, with figures, is
//! in docs/notes/optimisation.md.
//!
//! The leaves of the tree have one record each; collapsing comes behind it and makes leaves of whatever is deeper than tracers can
//! walk. The twin is [`Bvh2::reinserted`](super::layout::Bvh2::reinserted): the same bytes.

use super::layout::{NODES_OFFSET, node_slots};
use crate::Result;
use crate::gpu::arguments;
use crate::gpu::{Context, Grid, Kernel, Recorder, Region, Step, fill, shaders};
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

/// Of [`ReinsertionOptions::of_passes`].
const STRIDE: u32 = 64;
/// Links that are not worth a round of less.
const LEAST_LINKS: u32 = 128;
/// Subtrees that a search may put off; what does not find room is not looked at.
pub(super) const STACK: usize = 32;
/// Nodes that a path may have on either side.
pub(super) const PATH: usize = 256;
/// A gain counts if it is more than this share of the pivot's area: less may be rounding.
pub(super) const LEAST_SHARE: f32 = 1.0 / 1_048_576.0;
/// And more than this, the scene's longest edge being about 1: less may be made of numbers that devices take for zero.
pub(super) const LEAST_GAIN: f32 = 1.0 / 1_152_921_504_606_846_976.0;

/// Bytes of `Move` in reinsertion.glsl.
const MOVE_BYTES: u64 = 12;
/// Bytes of an entry of a search's stack, `Below` in reinsertion_search.comp.
const ENTRY_BYTES: u32 = 8;

/// Rounds of reinsertion, for one device and a number of primitives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reinsertion {
    slots: u32,
    stride: u32,
    rounds: u32,
    grid: Grid,
    shared: u32,
}

impl Reinsertion {
    /// For structures of `primitive_count` primitives.
    pub fn new(context: &Context, options: &ReinsertionOptions, primitive_count: u32) -> Reinsertion {
        let tuning = &context.tuning;
        // As many invocations as the grid has, in workgroups small enough for their stacks.
        let groups = tuning.grid.groups * (tuning.grid.workgroup / tuning.small_group).max(1);
        let groups = groups.min(context.limits.workgroup_count);
        let grid = Grid { workgroup: tuning.small_group, groups, rounds: tuning.build.reinsertion_rounds };
        let bytes = ENTRY_BYTES * tuning.small_group;
        let shared = tuning.build.reinsertion_shared.min(context.limits.shared_memory / bytes).min(STACK as u32);
        let slots = node_slots(primitive_count);
        Reinsertion { slots, stride: options.stride_for(slots), rounds: options.rounds_for(slots), grid, shared }
    }

    fn link_count(&self) -> u32 {
        2 * self.slots
    }

    /// Bytes of scratch memory.
    pub fn scratch_bytes(&self) -> u64 {
        let moves = u64::from(self.link_count().div_ceil(self.stride));
        12 * u64::from(self.slots) + MOVE_BYTES * moves
    }

    fn kernel(&self, shader: &'static shaders::Shader) -> Kernel {
        Kernel::new(shader, self.grid.workgroup, &[self.grid.rounds, self.shared])
    }

    /// Records all rounds on `structure`, in place, with scratch memory of [`Reinsertion::scratch_bytes`]; both aligned
    /// to 16 bytes. Five dispatches a round with barriers between; the caller places one before and one behind. Label: `optimise`.
    ///
    /// # Errors
    /// The memory is too small; a pipeline could not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, structure: Region, scratch: Region) -> Result<()> {
        let structure = structure.checked("the BVH to optimise", NODES_OFFSET, 16)?;
        let scratch = scratch.checked("scratch memory of an optimisation", self.scratch_bytes(), 16)?;
        recorder.chains(&[self.steps(structure, scratch)])
    }

    /// What [`Reinsertion::record`] records, with addresses that were checked.
    pub(super) fn steps(&self, structure: u64, scratch: u64) -> Vec<Step> {
        let words = 4 * u64::from(self.slots);
        let arguments = |offset: u32| arguments::Reinsertion {
            structure,
            parents: scratch,
            gains: scratch + words,
            firsts: scratch + 2 * words,
            moves: scratch + 3 * words,
            offset,
            stride: self.stride,
            link_count: self.link_count(),
        };
        let step = |shader, offset, items| {
            Step::new(PHASE, self.kernel(shader), &arguments(offset), self.grid.groups_for(items))
        };
        let tried = self.link_count().div_ceil(self.stride);
        let round = |round: u32| {
            let unlock = fill::step(PHASE, scratch + words, 2 * self.slots, 0);
            [unlock].into_iter().chain(STEPS.map(|shader| step(shader, round % self.stride, tried)))
        };
        [step(&shaders::BVH_REINSERTION_PARENTS, 0, self.slots)]
            .into_iter()
            .chain((0..self.rounds).flat_map(round))
            .collect()
    }
}

const PHASE: &str = "optimise";
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
