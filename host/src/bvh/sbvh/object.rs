//! Object splits: each reference is on one side, by the bin of its centroid.

use super::{ALONE, Search, Unsplit};
use crate::bvh::bounds::{Bounds, Item, around};
use crate::bvh::heuristic::split_cost::{Place, Side, SplitCost};
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

impl<S: SplitCost> Search<'_, S> {
    /// The plane between bins that costs least, of equal ones the first along the first axis.
    pub(super) fn object_split(&self, references: &[Item], node: &Unsplit) -> ObjectSplit {
        let bins = self.build.bins;
        let of_axis = |axis| Some(self.object_split_by(references, Grid::new(&node.centroids, axis, bins)?));
        let splits = of_axes(references.len(), of_axis);
        let cheaper = |a: ObjectSplit, b: ObjectSplit| if b.cost < a.cost { b } else { a };
        splits.into_iter().flatten().reduce(cheaper).unwrap_or_else(|| self.halved(references))
    }

    /// Half of the references on either side, in the order that they are in.
    pub(super) fn halved(&self, references: &[Item]) -> ObjectSplit {
        let (left, right) = references.split_at(references.len() / 2);
        let side = |references: &[Item]| {
            references.iter().map(|reference| self.side_of(reference)).fold(Side::EMPTY, Side::union)
        };
        let places = references.iter().enumerate().map(|(at, reference)| {
            let side = usize::from(at >= left.len());
            Place { primitive: reference.primitive(), first: side, last: side }
        });
        let cost = self.costs(&[left, right].map(side), [|side| *side, |side| *side], places)[0];
        ObjectSplit { cost, sides: [left, right].map(around), by: By::Order }
    }

    /// One reference.
    pub(super) fn side_of(&self, reference: &Item) -> Side {
        Side::of_one(reference.bounds(), self.by.is_seen(reference))
    }

    fn object_split_by(&self, references: &[Item], grid: Grid) -> ObjectSplit {
        let mut bins = vec![Side::EMPTY; grid.bins];
        for reference in references {
            let bin = &mut bins[grid.bin_of(reference)];
            *bin = bin.union(self.side_of(reference));
        }
        let places = references.iter().map(|reference| {
            let bin = grid.bin_of(reference);
            Place { primitive: reference.primitive(), first: bin, last: bin }
        });
        let costs = self.costs(&bins, [|bin| *bin, |bin| *bin], places);
        let cheaper = |best: (usize, f32), plane: (usize, f32)| if plane.1 < best.1 { plane } else { best };
        let (bin, cost) = (1..).zip(costs).fold((1, f32::INFINITY), cheaper);
        let of = |bins: &[Side]| bins.iter().fold(Bounds::EMPTY, |all, bin| all.union(bin.bounds));
        ObjectSplit { cost, sides: [of(&bins[..bin]), of(&bins[bin..])], by: By::Bins(grid, bin) }
    }
}

/// What is found along each axis, side by side if there are many references.
pub(super) fn of_axes<T: Send>(count: usize, of_axis: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if count < ALONE { (0..3).map(of_axis).collect() } else { (0..3).into_par_iter().map(&of_axis).collect() }
}
