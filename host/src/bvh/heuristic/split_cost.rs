//! What builders that go top-down ask a heuristic for: weights of the sides of splits.
//!
//! A side costs its weight times its primitives; the split that costs least in sum is taken. The weight of a heuristic that looks
//! at a box alone is the box's; one that knows the node's rays or visible primitives hands them down with every split.

use super::RayMeasure;
use crate::bvh::bounds::{Bounds, Item};
use hedgerow::bvh::sah::Collapse;

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

    /// Of one reference, which counts once.
    #[inline(always)]
    pub fn of_one(bounds: Bounds, is_seen: bool) -> Side {
        Side { bounds, count: 1, seen: u32::from(is_seen) }
    }

    /// Whether its box has nothing in it.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.bounds.lo.cmpgt(self.bounds.hi).any()
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
    growing_on(Side::EMPTY, sides)
}

/// The same, and together with `all`.
#[inline(always)]
fn growing_on(all: Side, sides: impl Iterator<Item = Side>) -> impl Iterator<Item = Side> {
    sides.scan(all, |all, side| {
        *all = all.union(side);
        Some(*all)
    })
}

/// What the planes between bins cost by a heuristic of which each side costs something on its own. Of a bin, `of_left` is what a plane
/// behind it has on the left, `of_right` what one before it has on the right.
#[inline(always)]
pub(crate) fn of_planes<C: SplitCost, B>(
    (by, here): (&C, &C::Here),
    bins: &[B],
    [of_left, of_right]: [fn(&B) -> Side; 2],
    costs: &Collapse,
) -> Vec<f32> {
    let cost = |(weight, side): (f32, Side)| costs.leaf_cost(weight, side.count);
    let around = |bins: &[B], of: fn(&B) -> Side| bins.iter().map(of).fold(Side::EMPTY, Side::union);
    let planes = bins.len() - 1;
    let mut all = vec![0.0; planes];
    // A part may be so thin that nothing is left of its box. No ray meets that.
    let thin = bins[..planes].iter().take_while(|bin| of_left(bin).is_empty()).count();
    let lefts = growing_on(around(&bins[..thin], of_left), bins[thin..planes].iter().map(of_left));
    let from_left = by.of_sides(here, lefts);
    all[thin..].iter_mut().zip(from_left).for_each(|(all, left)| *all = cost(left));
    let thin = bins[1..].iter().rev().take_while(|bin| of_right(bin).is_empty()).count();
    let (bins, thin_bins) = bins[1..].split_at(planes - thin);
    let rights = growing_on(around(thin_bins, of_right), bins.iter().rev().map(of_right));
    let from_right = by.of_sides(here, rights);
    all[..bins.len()].iter_mut().rev().zip(from_right).for_each(|(all, right)| *all += cost(right));
    all
}

/// The splits of a node along an axis. Each left side is in the next one, each right side in the one before.
pub(crate) struct AxisSplits<'a> {
    pub lefts: &'a [Side],
    pub rights: &'a [Side],
}

/// Where an item is among the splits of an axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub primitive: u32,
    /// It is in the left sides from this one on.
    pub first: usize,
    /// It is in the right sides before this one. That is `first`, unless the item is divided.
    pub last: usize,
}

/// Which side of a split becomes the left child.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum First {
    Left,
    Right,
}

impl First {
    /// What belongs to both sides, that of the left child before the other.
    #[inline(always)]
    pub fn in_order<T>(self, [left, right]: [T; 2]) -> [T; 2] {
        match self {
            First::Left => [left, right],
            First::Right => [right, left],
        }
    }
}

/// Calls back with the side of each item, 0 or 1, and its primitive.
pub(crate) type Members<'a> = dyn Fn(&mut dyn FnMut(usize, u32)) + 'a;

/// Where planes that divide items are looked at, by builders that have some.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Space {
    Nowhere,
    /// Where the sides of the best split of whole items overlap.
    Overlaps,
    /// At this node.
    Here,
    /// At this node, and no split of whole items unless there is none of space.
    Alone,
}

/// What costs splits by a heuristic.
pub(crate) trait SplitCost: Sync {
    /// What it knows of a node besides its box.
    type Here: Send + Sync;
    /// What its splits are compared with.
    type Rival: SplitCost<Here = ()>;
    /// Whether no box weighs less than one in it.
    const GROWS: bool = false;
    /// Whether a side's cost depends on the other one, so that only [`SplitCost::of_splits`] knows it.
    const BY_BOTH: bool = false;

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

    /// What splits of an axis cost, where each of a node's items is in one place.
    fn of_splits(
        &self,
        here: &Self::Here,
        splits: &AxisSplits<'_>,
        _places: impl Iterator<Item = Place>,
        costs: &Collapse,
    ) -> Vec<f32> {
        let cost = |side: &Side| -> f32 {
            let weighed = (!side.is_empty()).then_some(*side).into_iter();
            self.of_sides(here, weighed).map(|(weight, side)| costs.leaf_cost(weight, side.count)).sum()
        };
        splits.lefts.iter().zip(splits.rights).map(|(left, right)| cost(left) + cost(right)).collect()
    }

    /// What it knows of both sides of the split that was taken, and which becomes the left child.
    fn divide(
        &self,
        here: Self::Here,
        sides: impl FnOnce() -> [Side; 2],
        members: &Members<'_>,
    ) -> (First, [Self::Here; 2]);

    /// Whether items may be divided in the node.
    #[inline(always)]
    fn space(&self, _here: &Self::Here) -> Space {
        Space::Overlaps
    }

    /// Whether an item that crosses the plane of a split may be left whole on this side.
    #[inline(always)]
    fn takes_whole(&self, _here: &Self::Here, _side: &Side) -> bool {
        true
    }

    /// What its best split of the node is compared with, if with anything: the best one by another cost.
    #[inline(always)]
    fn rival(&self, _here: &Self::Here) -> Option<Self::Rival> {
        None
    }

    /// Whether its own split is taken then.
    fn prefers(&self, _own: &[Side; 2], _rival: &[Side; 2]) -> bool {
        true
    }
}

/// The surface area (Goldsmith and Salmon 1987; MacDonald and Booth 1990).
pub(crate) struct Area;

impl SplitCost for Area {
    type Here = ();
    type Rival = Area;
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
    fn divide(&self, _here: (), _sides: impl FnOnce() -> [Side; 2], _members: &Members<'_>) -> (First, [(); 2]) {
        (First::Left, [(); 2])
    }
}

/// A measure of rays.
pub(crate) struct ByRays<'a>(pub &'a dyn RayMeasure);

impl SplitCost for ByRays<'_> {
    type Here = ();
    type Rival = Area;

    fn root(&self, _whole: impl FnOnce() -> Side) {}

    fn of_node(&self, _here: &(), bounds: &Bounds) -> f32 {
        self.0.rays(&bounds.aabb())
    }

    fn of_sides(&self, _here: &(), sides: impl Iterator<Item = Side>) -> impl Iterator<Item = (f32, Side)> {
        sides.map(|side| (self.0.rays(&side.bounds.aabb()), side))
    }

    fn divide(&self, _here: (), _sides: impl FnOnce() -> [Side; 2], _members: &Members<'_>) -> (First, [(); 2]) {
        (First::Left, [(); 2])
    }
}
