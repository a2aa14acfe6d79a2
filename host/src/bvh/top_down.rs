//! The recursion of builders that go top-down: over the splits that a node may have, and what they cost.
//!
//! [`Candidates`] are all splits of three orders ([`super::sweep`]) or the planes between bins ([`super::binned`]); a
//! [`SplitCost`] is a heuristic. Subtrees are built side by side, and nothing in one depends on the other: the tree is the same for
//! any number of threads.

use super::heuristic::split_cost::{Area, Side, SplitCost};
use super::topology::LEAF;
use super::{ALONE, DIVIDED_ABOVE};
use hedgerow::bvh::layout::MAX_DEPTH;
use hedgerow::bvh::sah::Collapse;

/// From this depth on nodes are split in the middle: 2³¹ primitives then end above [`MAX_DEPTH`].
pub(super) const HALVED_FROM: u32 = MAX_DEPTH - 32;

/// Where nodes are split no further.
#[derive(Clone, Copy)]
pub(super) struct LeafRule<'a> {
    pub costs: &'a Collapse,
    /// Only where one item is left.
    pub single: bool,
}

impl LeafRule<'_> {
    /// Whether a leaf of this weight is cheaper than a node over sides of this cost.
    #[inline(always)]
    pub fn is_leaf(&self, weight: f32, count: u32, sides: f32) -> bool {
        !self.single && self.costs.leaf_cost(weight, count) < self.costs.inner_cost(weight, sides, 0.0)
    }
}

/// The splits that nodes may have.
pub(super) trait Candidates: Sync {
    /// The items of a node, and where its subtree is written.
    type Part<'a>: Send;
    /// One of the splits.
    type Split;

    /// The split of a part that costs least; `None` if it is a leaf.
    fn best<C: SplitCost>(&self, by: &C, here: &C::Here, part: &mut Self::Part<'_>, depth: u32) -> Option<Self::Split>;

    /// What a split has on either side; of the whole without one, all on the left.
    fn sides(&self, by: &impl SplitCost, part: &Self::Part<'_>, split: Option<&Self::Split>) -> [Side; 2];

    /// Both sides, and how many items the left one has.
    fn divide<'a>(&self, part: Self::Part<'a>, split: Self::Split) -> (usize, [Self::Part<'a>; 2]);

    /// The part is in a leaf.
    fn end(&self, part: Self::Part<'_>);
}

/// Builds the tree over `part`, of which `splits` has one slot fewer than items.
pub(super) fn build<C: Candidates>(candidates: &C, by: &impl SplitCost, part: C::Part<'_>, splits: &mut [u32]) {
    let here = by.root(|| candidates.sides(by, &part, None)[0]);
    TopDown { candidates, by }.subtree(part, here, splits, 0);
}

struct TopDown<'a, C, S> {
    candidates: &'a C,
    by: &'a S,
}

impl<C: Candidates, S: SplitCost> TopDown<'_, C, S> {
    fn subtree(&self, mut part: C::Part<'_>, here: S::Here, splits: &mut [u32], depth: u32) {
        let count = splits.len() + 1;
        let Some((slot, splits)) = splits.split_first_mut() else { return self.candidates.end(part) };
        let Some(split) = self.best(&mut part, &here, depth) else {
            *slot = LEAF;
            return self.candidates.end(part);
        };
        let [left_here, right_here] = self.by.divide(here, || self.candidates.sides(self.by, &part, Some(&split)));
        let (left_count, [left, right]) = self.candidates.divide(part, split);
        *slot = left_count as u32;
        let (left_splits, right_splits) = splits.split_at_mut(left_count - 1);
        let depth = depth + 1;
        if count < ALONE || depth > DIVIDED_ABOVE {
            self.subtree(left, left_here, left_splits, depth);
            self.subtree(right, right_here, right_splits, depth);
        } else {
            rayon::join(
                || self.subtree(left, left_here, left_splits, depth),
                || self.subtree(right, right_here, right_splits, depth),
            );
        }
    }

    /// The split that is taken.
    #[inline(always)]
    fn best(&self, part: &mut C::Part<'_>, here: &S::Here, depth: u32) -> Option<C::Split> {
        let own = self.candidates.best(self.by, here, part, depth)?;
        Some(if self.by.compares(here) { self.compared(own, part, depth) } else { own })
    }

    /// The heuristic's own split, or the best one by area. Not inlined: most heuristics do not compare.
    #[inline(never)]
    fn compared(&self, own: C::Split, part: &mut C::Part<'_>, depth: u32) -> C::Split {
        let Some(by_area) = self.candidates.best(&Area, &(), part, depth) else { return own };
        let sides = |split| self.candidates.sides(self.by, part, Some(split));
        if self.by.prefers(&sides(&own), &sides(&by_area)) { own } else { by_area }
    }
}
