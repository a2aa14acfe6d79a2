//! Bins of a node, and what fills them: by all threads where there are many items, each with a piece of its own.

use crate::bvh::bounds::{Bounds, Item};
use crate::bvh::heuristic::split_cost::{Side, SplitCost};
use rayon::prelude::*;

/// From this many items on a node is binned and divided by all threads.
const TOGETHER: usize = 1 << 16;
/// What one of them takes at a time.
const PIECE: usize = 1 << 13;
/// A node of this many items at most has fewer of them than bins, or not many more.
pub(super) const FEW: usize = 16;
/// Centroids whose extent is less than this part of the scene's are not told apart by an axis.
const LEAST_EXTENT: f32 = 1.0 / (1u64 << 60) as f32;

/// A node before it is split: the box around its items, and that around their centroids (twice them).
#[derive(Debug, Clone, Copy)]
pub(super) struct Unsplit {
    pub bounds: Bounds,
    pub centroids: Bounds,
}

impl Unsplit {
    pub const EMPTY: Unsplit = Unsplit { bounds: Bounds::EMPTY, centroids: Bounds::EMPTY };

    #[inline(always)]
    pub fn add(&mut self, item: &Item) {
        let bounds = item.bounds();
        self.bounds = self.bounds.union(bounds);
        self.centroids = self.centroids.union(Bounds::point(bounds.lo + bounds.hi));
    }

    #[inline(always)]
    pub fn union(self, other: Unsplit) -> Unsplit {
        Unsplit { bounds: self.bounds.union(other.bounds), centroids: self.centroids.union(other.centroids) }
    }
}

/// Equal bins along an axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub axis: usize,
    least: f32,
    per_length: f32,
    pub bins: usize,
}

impl Grid {
    /// Over what extends that far; `None` where centroids cannot be told apart.
    pub fn new(centroids: &Bounds, axis: usize, bins: usize) -> Option<Grid> {
        let (least, most) = (centroids.lo[axis], centroids.hi[axis]);
        let extent = most - least;
        (extent > LEAST_EXTENT).then(|| Grid { axis, least, per_length: bins as f32 / extent, bins })
    }

    /// How many bins it is from the first one's beginning.
    #[inline(always)]
    pub fn place(&self, item: &Item) -> f32 {
        (item.centroid_on(self.axis) - self.least) * self.per_length
    }

    #[inline(always)]
    pub fn bin_of(&self, item: &Item) -> usize {
        (self.place(item) as usize).min(self.bins - 1)
    }
}

#[inline(always)]
pub(super) fn side_of(by: &impl SplitCost, item: &Item) -> Side {
    // Each counts once here: a constant is cheaper than what an item keeps.
    Side { bounds: item.bounds(), count: 1, seen: u32::from(by.is_seen(item)) }
}

pub(super) fn side(by: &impl SplitCost, items: &[Item]) -> Side {
    items.iter().fold(Side::EMPTY, |all, item| all.union(side_of(by, item)))
}

/// Around the centroids of items (twice them), by all threads if there are many.
pub(super) fn centroids(items: &[Item]) -> Bounds {
    let alone =
        |items: &[Item]| items.iter().fold(Bounds::EMPTY, |all, item| all.union(Bounds::point(item.centroid())));
    if !is_for_all(items) {
        return alone(items);
    }
    items.par_chunks(PIECE).map(alone).reduce(|| Bounds::EMPTY, Bounds::union)
}

/// The boxes of a node over these items, by all threads if there are many.
pub(super) fn measured(items: &[Item]) -> Unsplit {
    items.par_chunks(PIECE).map(measured_alone).reduce(|| Unsplit::EMPTY, Unsplit::union)
}

/// The same by one thread.
#[inline(always)]
pub(super) fn measured_alone(items: &[Item]) -> Unsplit {
    let mut all = Unsplit::EMPTY;
    items.iter().for_each(|item| all.add(item));
    all
}

/// Whether all threads work on a node together. One that has no others reads its items once, and in place.
fn is_for_all(items: &[Item]) -> bool {
    items.len() >= TOGETHER && rayon::current_num_threads() > 1
}

/// The place of an item that [`in_order_of_bins`] keeps beside its bin.
#[inline(always)]
pub(super) fn place_of(key: u32) -> usize {
    (key & 0xff) as usize
}

/// The bin of each item, and its place in the eight bits below, in the order of the bins.
#[inline(always)]
pub(super) fn in_order_of_bins(items: &[Item], grid: &Grid) -> [u32; FEW] {
    let mut order = [u32::MAX; FEW];
    for (i, item) in items.iter().enumerate() {
        let key = (grid.bin_of(item) << 8 | i) as u32;
        let mut at = i;
        while at > 0 && order[at - 1] > key {
            order[at] = order[at - 1];
            at -= 1;
        }
        order[at] = key;
    }
    order
}

/// Adds items to the bins of grids along one axis each, the first of `N`; by all threads if there are many items.
pub(super) fn fill<const N: usize>(by: &impl SplitCost, items: &[Item], grids: &[Grid], bins: &mut [[Side; N]]) {
    if !is_for_all(items) {
        return fill_alone(by, items, grids, bins);
    }
    let empty = || vec![[Side::EMPTY; N]; grids.len()];
    let of_piece = |items: &[Item]| {
        let mut bins = empty();
        fill_alone(by, items, grids, &mut bins);
        bins
    };
    let union = |mut a: Vec<[Side; N]>, b: Vec<[Side; N]>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| unite(a, b));
        a
    };
    bins.copy_from_slice(&items.par_chunks(PIECE).map(of_piece).reduce(empty, union));
}

/// The same by one thread.
fn fill_alone<const N: usize>(by: &impl SplitCost, items: &[Item], grids: &[Grid], bins: &mut [[Side; N]]) {
    if let ([x, y, z], [of_x, of_y, of_z]) = (grids, &mut *bins) {
        // An item is read once for all axes, and what is added along one need not wait for another.
        return items.iter().for_each(|item| {
            add(by, item, x, of_x);
            add(by, item, y, of_y);
            add(by, item, z, of_z);
        });
    }
    grids.iter().zip(bins).for_each(|(grid, bins)| fill_along(by, items, grid, bins));
}

#[inline(always)]
fn add<const N: usize>(by: &impl SplitCost, item: &Item, grid: &Grid, bins: &mut [Side; N]) {
    let bin = &mut bins[grid.bin_of(item)];
    *bin = bin.union(side_of(by, item));
}

/// The same along one axis.
fn fill_along<const N: usize>(by: &impl SplitCost, items: &[Item], grid: &Grid, bins: &mut [Side; N]) {
    if items.len() < 4 * N {
        return items.iter().for_each(|item| add(by, item, grid, bins));
    }
    // Neighbours often are in the same bin: two sets of bins, as the one need not wait for the other.
    let mut others = [Side::EMPTY; N];
    let pairs = items.chunks_exact(2);
    pairs.remainder().iter().for_each(|item| add(by, item, grid, bins));
    for pair in pairs {
        add(by, &pair[0], grid, bins);
        add(by, &pair[1], grid, &mut others);
    }
    unite(&mut bins[..grid.bins], &others[..grid.bins]);
}

/// Adds what is in other bins.
fn unite(bins: &mut [Side], others: &[Side]) {
    bins.iter_mut().zip(others).for_each(|(bin, other)| *bin = bin.union(*other));
}

/// Writes the `left_count` items that are on the left before the others, both in the order that they were in.
pub(in crate::bvh) fn partition(
    items: &[Item],
    to: &mut [Item],
    left_count: usize,
    is_left: impl Fn(&Item) -> bool + Sync,
) {
    if !is_for_all(items) {
        return spread(items, to, left_count, is_left);
    }
    let counts: Vec<usize> =
        items.par_chunks(PIECE).map(|piece| piece.iter().filter(|item| is_left(item)).count()).collect();
    let (mut left, mut right) = to.split_at_mut(left_count);
    let mut places = Vec::with_capacity(counts.len());
    for (piece, &on_left) in items.chunks(PIECE).zip(&counts) {
        let (left_place, left_rest) = left.split_at_mut(on_left);
        let (right_place, right_rest) = right.split_at_mut(piece.len() - on_left);
        places.push((piece, left_place, right_place));
        (left, right) = (left_rest, right_rest);
    }
    places.into_par_iter().for_each(|(piece, left, right)| {
        let (mut left, mut right) = (left.iter_mut(), right.iter_mut());
        for item in piece {
            let place = if is_left(item) { left.next() } else { right.next() };
            *place.expect("counted before") = *item;
        }
    });
}

/// The same by one thread.
fn spread(items: &[Item], to: &mut [Item], left_count: usize, is_left: impl Fn(&Item) -> bool) {
    let (mut left, mut right) = (0, left_count);
    for item in items {
        let is_left = is_left(item);
        // Chosen without a branch, which would be guessed wrongly half the time.
        to[if is_left { left } else { right }] = *item;
        left += usize::from(is_left);
        right += usize::from(!is_left);
    }
}
