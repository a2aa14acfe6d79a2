//! The recursion of builders that go top-down: over the splits that a node may have, and what they cost.
//!
//! [`Candidates`] are all splits of three orders ([`super::sweep`]), the planes between bins ([`super::binned`]), or these and planes
//! that divide items ([`super::sbvh`]); a [`SplitCost`] is a heuristic. Subtrees are built side by side, and nothing in one depends on
//! the other: the tree is the same for any number of threads.

use super::heuristic::split_cost::{First, Side, SplitCost};
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

    /// How many items a part has.
    fn count(&self, part: &Self::Part<'_>) -> usize;

    /// The split of a part of two items or more that costs least; `None` if it is a leaf.
    fn best<C: SplitCost>(&self, by: &C, here: &C::Here, part: &mut Self::Part<'_>, depth: u32) -> Option<Self::Split>;

    /// What a split has on either side; of the whole without one, all on the left.
    fn sides(&self, by: &impl SplitCost, part: &Self::Part<'_>, split: Option<&Self::Split>) -> [Side; 2];

    /// Calls back with the side of each item, 0 or 1, and its primitive.
    fn members(&self, part: &Self::Part<'_>, split: &Self::Split, each: &mut dyn FnMut(usize, u32));

    /// The parts of both children.
    fn divide<'a>(&self, part: Self::Part<'a>, split: Self::Split, first: First) -> [Self::Part<'a>; 2];

    /// The part is in a leaf.
    fn end(&self, part: Self::Part<'_>);
}

/// Writes to the first of a node's slots how many items its left child has; those of both children.
pub(super) fn divided_slots(slots: &mut [u32], left_count: usize) -> [&mut [u32]; 2] {
    let (slot, slots) = slots.split_first_mut().expect("a node has a slot");
    *slot = left_count as u32;
    let (left, right) = slots.split_at_mut(left_count - 1);
    [left, right]
}

/// Builds the tree over `part`.
pub(super) fn build<C: Candidates>(candidates: &C, by: &impl SplitCost, part: C::Part<'_>) {
    let here = by.root(|| candidates.sides(by, &part, None)[0]);
    TopDown { candidates, by }.subtree(part, here, 0);
}

struct TopDown<'a, C, S> {
    candidates: &'a C,
    by: &'a S,
}

impl<C: Candidates, S: SplitCost> TopDown<'_, C, S> {
    fn subtree(&self, mut part: C::Part<'_>, here: S::Here, depth: u32) {
        let count = self.candidates.count(&part);
        let split = if count > 1 { self.best(&mut part, &here, depth) } else { None };
        let Some(split) = split else { return self.candidates.end(part) };
        let sides = || self.candidates.sides(self.by, &part, Some(&split));
        let members = |each: &mut dyn FnMut(usize, u32)| self.candidates.members(&part, &split, each);
        let (first, heres) = self.by.divide(here, sides, &members);
        let [left_here, right_here] = first.in_order(heres);
        let [left, right] = self.candidates.divide(part, split, first);
        let depth = depth + 1;
        if count < ALONE || depth > DIVIDED_ABOVE {
            self.subtree(left, left_here, depth);
            self.subtree(right, right_here, depth);
        } else {
            rayon::join(|| self.subtree(left, left_here, depth), || self.subtree(right, right_here, depth));
        }
    }

    /// The split that is taken.
    #[inline(always)]
    fn best(&self, part: &mut C::Part<'_>, here: &S::Here, depth: u32) -> Option<C::Split> {
        let own = self.candidates.best(self.by, here, part, depth)?;
        Some(match self.by.rival(here) {
            Some(rival) => self.compared(own, &rival, part, depth),
            None => own,
        })
    }

    /// The heuristic's own split, or the best one by another cost. Not inlined: most heuristics do not compare.
    #[inline(never)]
    fn compared(&self, own: C::Split, rival: &S::Rival, part: &mut C::Part<'_>, depth: u32) -> C::Split {
        let Some(by_rival) = self.candidates.best(rival, &(), part, depth) else { return own };
        let sides = |split| self.candidates.sides(self.by, part, Some(split));
        if self.by.prefers(&sides(&own), &sides(&by_rival)) { own } else { by_rival }
    }
}
