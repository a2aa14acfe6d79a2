//! Object splits: each reference is on one side, by the bin of its centroid.

use super::{ALONE, Build, Side, Unsplit};
use crate::bvh::bounds::{Bounds, Item};
use rayon::prelude::*;

/// Centroids whose extent is less than this part of the scene's are not told apart by an axis.
const LEAST_EXTENT: f32 = 1.0 / (1u64 << 60) as f32;

/// A split by objects.
pub(super) struct ObjectSplit {
    pub cost: f32,
    sides: [Bounds; 2],
    by: By,
}

/// What tells which side a reference is on.
enum By {
    /// The bins of a grid, as many as there are on the left.
    Bins(Grid, usize),
    /// The order that they are in, half of them each.
    Order,
}

/// Equal bins of centroids along an axis.
#[derive(Clone, Copy)]
struct Grid {
    axis: usize,
    least: f32,
    per_length: f32,
    bins: usize,
}

impl Grid {
    fn new(centroids: &Bounds, axis: usize, bins: usize) -> Option<Grid> {
        let (least, most) = (centroids.lo[axis], centroids.hi[axis]);
        let extent = most - least;
        (extent > LEAST_EXTENT).then(|| Grid { axis, least, per_length: bins as f32 / extent, bins })
    }

    fn bin_of(&self, reference: &Item) -> usize {
        let place = (reference.centroid_on(self.axis) - self.least) * self.per_length;
        (place as usize).min(self.bins - 1)
    }
}

impl ObjectSplit {
    /// The area that the boxes of both sides have in common.
    pub fn overlap(&self) -> f32 {
        let [left, right] = self.sides;
        let common = Bounds { lo: left.lo.max(right.lo), hi: left.hi.min(right.hi) };
        if common.lo.cmpgt(common.hi).any() { 0.0 } else { common.half_area() }
    }

    pub fn divide(&self, references: &[Item]) -> [Vec<Item>; 2] {
        match &self.by {
            By::Order => {
                let (left, right) = references.split_at(references.len() / 2);
                [left.to_vec(), right.to_vec()]
            }
            By::Bins(grid, bin) => {
                let (left, right) = references.iter().partition(|reference| grid.bin_of(reference) < *bin);
                [left, right]
            }
        }
    }
}

impl<C: Fn(u32) -> [[f32; 3]; 3] + Sync> Build<'_, C> {
    /// The plane between bins that costs least, of equal ones the first along the first axis.
    pub(super) fn object_split(&self, references: &[Item], node: &Unsplit) -> ObjectSplit {
        let of_axis = |axis| Some(self.object_split_by(references, Grid::new(&node.centroids, axis, self.bins)?));
        let splits = of_axes(references.len(), of_axis);
        let cheaper = |a: ObjectSplit, b: ObjectSplit| if b.cost < a.cost { b } else { a };
        splits.into_iter().flatten().reduce(cheaper).unwrap_or_else(|| self.halved(references))
    }

    /// Half of the references on either side, in the order that they are in.
    pub(super) fn halved(&self, references: &[Item]) -> ObjectSplit {
        let (left, right) = references.split_at(references.len() / 2);
        let sides = [left, right].map(|side| Side { bounds: crate::bvh::bounds::around(side), count: side.len() });
        let [left, right] = sides.map(|side| side.cost(self.costs));
        ObjectSplit { cost: left + right, sides: sides.map(|side| side.bounds), by: By::Order }
    }

    fn object_split_by(&self, references: &[Item], grid: Grid) -> ObjectSplit {
        let mut bins = vec![Side::EMPTY; grid.bins];
        for reference in references {
            let bin = &mut bins[grid.bin_of(reference)];
            *bin = bin.add(reference.bounds(), 1);
        }
        let mut rights = vec![Side::EMPTY; grid.bins + 1];
        for bin in (1..grid.bins).rev() {
            rights[bin] = rights[bin + 1].add(bins[bin].bounds, bins[bin].count);
        }
        let mut best = ObjectSplit { cost: f32::INFINITY, sides: [Bounds::EMPTY; 2], by: By::Bins(grid, 1) };
        let mut left = Side::EMPTY;
        for bin in 1..grid.bins {
            left = left.add(bins[bin - 1].bounds, bins[bin - 1].count);
            let cost = left.cost(self.costs) + rights[bin].cost(self.costs);
            if cost < best.cost {
                best = ObjectSplit { cost, sides: [left.bounds, rights[bin].bounds], by: By::Bins(grid, bin) };
            }
        }
        best
    }
}

/// What is found along each axis, side by side if there are many references.
pub(super) fn of_axes<T: Send>(count: usize, of_axis: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if count < ALONE { (0..3).map(of_axis).collect() } else { (0..3).into_par_iter().map(&of_axis).collect() }
}
