//! What builders that go top-down ask a heuristic for: weights of the sides of splits.
//!
//! A side costs its weight times its primitives; the split that costs least in sum is taken. The weight of a heuristic that looks
//! at a box alone is the box's; one that knows the node's rays or visible primitives hands them down with every split.

use super::RayMeasure;
use crate::bvh::bounds::{Bounds, Item};

/// What lies on one side of a split.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Side {
    pub bounds: Bounds,
    /// How many primitives.
    pub count: u32,
    /// How many of them are seen, where the heuristic knows of that.
    pub seen: u32,
}

impl Side {
    pub const EMPTY: Side = Side { bounds: Bounds::EMPTY, count: 0, seen: 0 };

    /// Of one item.
    #[inline(always)]
    pub fn of(item: &Item, is_seen: bool) -> Side {
        Side { bounds: item.bounds(), count: item.weight(), seen: u32::from(is_seen) }
    }

    #[inline(always)]
    pub fn union(self, other: Side) -> Side {
        let (count, seen) = (self.count + other.count, self.seen + other.seen);
        Side { bounds: self.bounds.union(other.bounds), count, seen }
    }
}

/// Each together with all before it.
#[inline(always)]
pub(crate) fn growing(sides: impl Iterator<Item = Side>) -> impl Iterator<Item = Side> {
    sides.scan(Side::EMPTY, |all, side| {
        *all = all.union(side);
        Some(*all)
    })
}

/// What costs splits by a heuristic.
pub(crate) trait SplitCost: Sync {
    /// What it knows of a node besides its box.
    type Here: Send + Sync;
    /// Whether no box weighs less than one in it.
    const GROWS: bool = false;

    /// What it knows of the root.
    fn root(&self, whole: impl FnOnce() -> Side) -> Self::Here;

    /// Whether it counts the item as seen.
    #[inline(always)]
    fn is_seen(&self, _item: &Item) -> bool {
        false
    }

    /// The weight of a node itself, in the unit of those of its sides.
    fn of_node(&self, here: &Self::Here, bounds: &Bounds) -> f32;

    /// Those of sides that splits of a node may have. Each is in the next.
    fn of_sides(&self, here: &Self::Here, sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)>;

    /// What it knows of both sides of the split that was taken.
    fn divide(&self, here: Self::Here, sides: impl FnOnce() -> [Side; 2]) -> [Self::Here; 2];

    /// Whether its best split of the node is compared with the best one by area.
    #[inline(always)]
    fn compares(&self, _here: &Self::Here) -> bool {
        false
    }

    /// Whether its own split is taken then.
    fn prefers(&self, _own: &[Side; 2], _by_area: &[Side; 2]) -> bool {
        true
    }
}

/// The surface area (Goldsmith and Salmon 1987; MacDonald and Booth 1990).
pub(crate) struct Area;

impl SplitCost for Area {
    type Here = ();
    const GROWS: bool = true;

    #[inline(always)]
    fn root(&self, _whole: impl FnOnce() -> Side) {}

    #[inline(always)]
    fn of_node(&self, _here: &(), bounds: &Bounds) -> f32 {
        bounds.half_area()
    }

    #[inline(always)]
    fn of_sides(&self, _here: &(), sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        sides.map(|side| (side.bounds.half_area(), side))
    }

    #[inline(always)]
    fn divide(&self, _here: (), _sides: impl FnOnce() -> [Side; 2]) -> [(); 2] {
        [(); 2]
    }
}

/// A measure of rays.
pub(crate) struct ByRays<'a>(pub &'a dyn RayMeasure);

impl SplitCost for ByRays<'_> {
    type Here = ();

    fn root(&self, _whole: impl FnOnce() -> Side) {}

    fn of_node(&self, _here: &(), bounds: &Bounds) -> f32 {
        self.0.rays(&bounds.aabb())
    }

    fn of_sides(&self, _here: &(), sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        sides.map(|side| (self.0.rays(&side.bounds.aabb()), side))
    }

    fn divide(&self, _here: (), _sides: impl FnOnce() -> [Side; 2]) -> [(); 2] {
        [(); 2]
    }
}
