//! Full sweep: top-down, at each node the best by SAH of all splits of all three orders by centroid.
//!
//! Wald, Boulos, Shirley 2007, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies", section 3; Frantál 2019,
//! sections 2.3.1 and 3.3.1. The orders are sorted once, before the first split: whatever the split, what is on the left keeps its
//! order, and so does what is on the right. Slow, and what the quality of other builders is compared with.

use super::bounds::{Bounds, Item};
use super::topology::{LEAF, Topology};
use super::{ALONE, DIVIDED_ABOVE};
use hedgerow::bvh::layout::MAX_DEPTH;
use hedgerow::bvh::sah::Collapse;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// From this depth on nodes are split in the middle: 2³¹ primitives then end above [`MAX_DEPTH`].
pub(super) const HALVED_FROM: u32 = MAX_DEPTH - 32;

/// The tree over `items`, of which each counts for its weight. A node becomes a leaf where that is cheaper than its best split;
/// with `single` it never does. The order is of positions in `items`.
pub(super) fn positions(items: &[Item], costs: &Collapse, single: bool) -> Topology {
    let count = items.len();
    let mut tree = Topology::new(count);
    if count == 0 {
        return tree;
    }
    let mut buffers = [0, 1, 2].map(|axis| {
        let mut keys: Vec<u64> = (0..count as u32)
            .map(|i| u64::from(ascending(items[i as usize].centroid_on(axis))) << 32 | u64::from(i))
            .collect();
        if count < ALONE {
            keys.sort_unstable();
        } else {
            keys.par_sort_unstable();
        }
        let order: Vec<u32> = keys.into_iter().map(|key| key as u32).collect();
        (order, vec![0; count], vec![0.0; count])
    });
    let sweep = Sweep { items, costs, single, is_left: (0..count).map(|_| AtomicBool::new(false)).collect() };
    let axes = buffers.each_mut().map(|(order, spare, areas)| Axis { order, spare, areas });
    sweep.subtree(axes, &mut tree.splits, 0);
    let [(order, ..), ..] = buffers;
    tree.order = order;
    tree
}

/// The tree over the primitives of `items`.
pub(super) fn build(items: &[Item], costs: &Collapse, single: bool) -> Topology {
    let mut tree = positions(items, costs, single);
    tree.order.par_iter_mut().with_min_len(ALONE).for_each(|i| *i = items[*i as usize].primitive());
    tree
}

/// Bits that are in the order of the floats.
fn ascending(x: f32) -> u32 {
    let bits = (x + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// The items of a node in the order of their centroids along an axis, and room as large.
struct Axis<'a> {
    order: &'a mut [u32],
    spare: &'a mut [u32],
    areas: &'a mut [f32],
}

impl<'a> Axis<'a> {
    fn split_at(self, count: usize) -> (Axis<'a>, Axis<'a>) {
        let (left_order, order) = self.order.split_at_mut(count);
        let (left_spare, spare) = self.spare.split_at_mut(count);
        let (left_areas, areas) = self.areas.split_at_mut(count);
        (Axis { order: left_order, spare: left_spare, areas: left_areas }, Axis { order, spare, areas })
    }

    /// Those on the left before the others, both as they were.
    fn partition(&mut self, is_left: &[AtomicBool]) {
        let (mut left, mut right) = (0, 0);
        for at in 0..self.order.len() {
            let i = self.order[at];
            let is_left = is_left[i as usize].load(Ordering::Relaxed);
            // Both are written and one of them stays: a branch here would be guessed wrongly half the time.
            self.order[left] = i;
            self.spare[right] = i;
            left += usize::from(is_left);
            right += usize::from(!is_left);
        }
        self.order[left..].copy_from_slice(&self.spare[..right]);
    }
}

/// A split: its cost, how far it is from the middle, and how many items are on the left. The less the better.
type Split = (f32, usize, usize);

fn better(a: Split, b: Split) -> bool {
    (b.0, b.1) < (a.0, a.1)
}

struct Sweep<'a> {
    items: &'a [Item],
    costs: &'a Collapse,
    single: bool,
    /// Of each item, whether the last split has put it on the left.
    is_left: Vec<AtomicBool>,
}

impl Sweep<'_> {
    /// Divides the items of `axes` among the subtrees whose slots are `splits`.
    fn subtree(&self, mut axes: [Axis<'_>; 3], splits: &mut [u32], depth: u32) {
        let Some((split, splits)) = splits.split_first_mut() else { return };
        let count = axes[0].order.len();
        let (axis, (cost, _, left_count), bounds, weight) = self.best_split(&mut axes);
        let area = bounds.half_area();
        if !self.single && self.costs.leaf_cost(area, weight) < self.costs.inner_cost(area, cost, 0.0) {
            *split = LEAF;
            return;
        }
        let left_count = if depth >= HALVED_FROM { count / 2 } else { left_count };
        *split = left_count as u32;
        for (at, &i) in axes[axis].order.iter().enumerate() {
            self.is_left[i as usize].store(at < left_count, Ordering::Relaxed);
        }
        for other in (0..3).filter(|&other| other != axis) {
            axes[other].partition(&self.is_left);
        }
        let [(x0, x1), (y0, y1), (z0, z1)] = axes.map(|axis| axis.split_at(left_count));
        let (left_splits, right_splits) = splits.split_at_mut(left_count - 1);
        let left = || self.subtree([x0, y0, z0], left_splits, depth + 1);
        let right = || self.subtree([x1, y1, z1], right_splits, depth + 1);
        if count < ALONE || depth >= DIVIDED_ABOVE {
            left();
            right();
        } else {
            rayon::join(left, right);
        }
    }

    /// The best split and its axis, the first of equal axes; the box around all items, and their weight.
    fn best_split(&self, axes: &mut [Axis<'_>; 3]) -> (usize, Split, Bounds, u32) {
        let [x, y, z] = axes;
        let [x, y, z] = if x.order.len() < ALONE {
            [self.best_split_of(x), self.best_split_of(y), self.best_split_of(z)]
        } else {
            let of = |axis| self.best_split_of(axis);
            let (x, (y, z)) = rayon::join(|| of(x), || rayon::join(|| of(y), || of(z)));
            [x, y, z]
        };
        let (bounds, weight) = (x.1, x.2);
        let best = [y.0, z.0]
            .into_iter()
            .zip(1..)
            .fold((0, x.0), |best, (split, axis)| if better(best.1, split) { (axis, split) } else { best });
        (best.0, best.1, bounds, weight)
    }

    fn best_split_of(&self, axis: &mut Axis<'_>) -> (Split, Bounds, u32) {
        let count = axis.order.len();
        let item = |i: u32| &self.items[i as usize];
        let (mut right, mut weight) = (Bounds::EMPTY, 0);
        for (&i, area) in axis.order.iter().zip(axis.areas.iter_mut()).rev() {
            right = right.union(item(i).bounds());
            weight += item(i).weight();
            *area = right.half_area();
        }
        let mut best = (f32::INFINITY, usize::MAX, 1);
        let (mut left, mut on_left) = (Bounds::EMPTY, 0);
        for at in 1..count {
            let item = item(axis.order[at - 1]);
            left = left.union(item.bounds());
            on_left += item.weight();
            let cost = self.costs.leaf_cost(left.half_area(), on_left)
                + self.costs.leaf_cost(axis.areas[at], weight - on_left);
            let split = (cost, (2 * at).abs_diff(count), at);
            if better(best, split) {
                best = split;
            }
        }
        (best, right, weight)
    }
}
