//! Min-max binning: at each cell the best of a few equally spaced planes along each axis (Shevtsov, Soupikov and Kapustin 2007,
//! "Highly Parallel Fast KD-tree Construction for Interactive Ray Tracing of Dynamic Scenes"; Papay 2025, sections 4.1 and 9.5).
//!
//! For each axis, one array counts the boxes that begin in a bin and another those that end there. Sums of the first from the left
//! are how many are on the left of a plane, sums of the second from the right how many on its right: the exact cost of each of the
//! planes, though not of the best there is.

use super::clip::{KdReference, divided};
use super::heuristic::{Heuristic, KdSplit};
use super::small::Small;
use super::{ALONE, Fork, Subtree};
use crate::bvh::layout::Triangle;
use crate::geometry::Aabb;
use crate::kdtree::layout::halves;

/// The tree over `references` in `cell`, with `bins` along each axis. Cells of at most `exact` references are split exactly.
pub fn build(
    fork: &impl Fork,
    heuristic: &Heuristic,
    records: (&[Triangle], f32),
    (bins, exact): (u32, u32),
    cell: Aabb,
    references: Vec<KdReference>,
) -> Subtree {
    Binned { fork, heuristic, records, bins: bins as usize, exact: exact as usize }.subtree(cell, references, 0)
}

struct Binned<'a, F> {
    fork: &'a F,
    heuristic: &'a Heuristic,
    /// The records, and what of them has no room.
    records: (&'a [Triangle], f32),
    bins: usize,
    /// References of a cell from which on bins are taken, less one.
    exact: usize,
}

impl<F: Fork> Binned<'_, F> {
    fn subtree(&self, cell: Aabb, references: Vec<KdReference>, depth: u32) -> Subtree {
        let count = references.len();
        if self.heuristic.is_leaf(count, depth) {
            return Subtree::leaf(&references);
        }
        if count <= self.exact {
            return Small::new(self.heuristic, self.records).tree(cell, references, depth);
        }
        let best = self.best_split(&cell, &references);
        let Some(KdSplit { plane, .. }) = self.heuristic.paying(best, &cell, count) else {
            return Subtree::leaf(&references);
        };
        let halves = halves(&cell, plane.axis, plane.at);
        let mut parts = [Vec::new(), Vec::new()];
        for reference in &references {
            let divided = divided(reference, self.records, &plane, &halves);
            parts.iter_mut().zip(divided).for_each(|(part, reference)| part.extend(reference));
        }
        drop(references);
        let ([left_cell, right_cell], [left, right]) = (halves, parts);
        Subtree::inner(
            self.fork,
            plane,
            count,
            || self.subtree(left_cell, left, depth + 1),
            || self.subtree(right_cell, right, depth + 1),
        )
    }

    /// The cheapest plane of all axes; of equal ones that of the first axis, and there the leftmost.
    fn best_split(&self, cell: &Aabb, references: &[KdReference]) -> Option<KdSplit> {
        let of = |axis| self.best_split_of(cell, axis, references);
        let [x, y, z] = if references.len() < ALONE { [0, 1, 2].map(of) } else { self.fork.axes(of) };
        KdSplit::better(KdSplit::better(x, y), z)
    }

    fn best_split_of(&self, cell: &Aabb, axis: usize, references: &[KdReference]) -> Option<KdSplit> {
        let planes = Planes::of(cell, axis, self.bins);
        let (mut begin, mut end) = (vec![0u32; self.bins], vec![0u32; self.bins]);
        for reference in references {
            let (lo, hi) = (reference.bounds.lo[axis], reference.bounds.hi[axis]);
            // What lies in a plane is on its left.
            begin[if lo == hi { planes.before(lo) } else { planes.not_beyond(lo) }] += 1;
            end[planes.before(hi)] += 1;
        }
        let (mut left, mut right) = (0, references.len() as u32);
        let mut best = None;
        for bin in 1..self.bins {
            left += begin[bin - 1];
            right -= end[bin - 1];
            let split = self.heuristic.split(cell, (axis, planes.at(bin)), [left, 0, right]);
            best = KdSplit::better(best, split.map(|split| split.with_planar_left()));
        }
        best
    }
}

/// The planes between the bins: number i, from 1 on, is the end of bin i − 1 and the beginning of bin i.
struct Planes {
    lo: f32,
    width: f32,
    bins_per_length: f32,
    bins: usize,
}

impl Planes {
    fn of(cell: &Aabb, axis: usize, bins: usize) -> Planes {
        // Halves, for the extent of a scene may exceed the largest float.
        let width = (0.5 * cell.hi[axis] - 0.5 * cell.lo[axis]) * (2.0 / bins as f32);
        Planes { lo: cell.lo[axis], width, bins_per_length: 1.0 / width, bins }
    }

    /// Never less than that of a lower number, as rounding keeps the order.
    fn at(&self, number: usize) -> f32 {
        self.lo + number as f32 * self.width
    }

    /// How many planes are not beyond `x`: the number of the bin in which a box begins there, as it is on the left of the planes
    /// that are.
    fn not_beyond(&self, x: f32) -> usize {
        let mut bin = self.near(x);
        while bin + 1 < self.bins && self.at(bin + 1) <= x {
            bin += 1;
        }
        while bin > 0 && self.at(bin) > x {
            bin -= 1;
        }
        bin
    }

    /// How many planes are before `x`: the number of the bin in which a box ends there, as it is on the right of those planes.
    fn before(&self, x: f32) -> usize {
        let mut bin = self.near(x);
        while bin + 1 < self.bins && self.at(bin + 1) < x {
            bin += 1;
        }
        while bin > 0 && self.at(bin) >= x {
            bin -= 1;
        }
        bin
    }

    /// A bin to begin with; which one has no say in the result.
    fn near(&self, x: f32) -> usize {
        (((x - self.lo) * self.bins_per_length) as usize).min(self.bins - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_count_what_comparing_with_each_plane_would() {
        for (lo, hi, bins) in [
            (0.0f32, 1.0f32, 32),
            (-7.3, 11.9, 7),
            (1e6, 1e6 + 2.0, 32),
            (1.0, 1.0 + 4.0 * f32::EPSILON, 16),
            (-3e38, 3e38, 32),
            (-1e-37, 1e-37, 5),
        ] {
            let cell = Aabb { lo: [lo; 3], hi: [hi; 3] };
            let planes = Planes::of(&cell, 0, bins);
            let mut samples: Vec<f32> =
                (0..=1000).map(|i| lo * (1.0 - i as f32 / 1000.0) + hi * (i as f32 / 1000.0)).collect();
            for number in 1..bins {
                let at = planes.at(number);
                samples.extend([at.next_down(), at, at.next_up()]);
            }
            samples.retain(|x| lo <= *x && *x <= hi);
            for x in samples {
                let count = |is: fn(f32, f32) -> bool| (1..bins).filter(|&n| is(planes.at(n), x)).count();
                assert_eq!(planes.not_beyond(x), count(|plane, x| plane <= x), "{x} in {lo}..{hi}");
                assert_eq!(planes.before(x), count(|plane, x| plane < x), "{x} in {lo}..{hi}");
            }
        }
    }
}
