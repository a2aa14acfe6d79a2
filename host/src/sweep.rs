//! Full sweep, plainly: top-down, at each node the best by SAH of all splits of all three orders by centroid.
//!
//! Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies", section 3.2; Frantál 2019, section 3.2. Slow, and
//! what the quality of other builders is compared with.

use hedgerow::bvh::layout::{Bvh2, Child, MAX_DEPTH, Node, Record};
use hedgerow::bvh::sah::Collapse;
use hedgerow::geometry::Aabb;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// When a node is split no further.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leaves {
    /// Where one primitive is left.
    Single,
    /// Where a leaf is cheaper than the best split into two leaves.
    Terminated,
}

/// From this depth on nodes are split in the middle: 2³¹ primitives then end above [`MAX_DEPTH`].
const HALVED_FROM: u32 = MAX_DEPTH - 32;
/// Fewer primitives than this are not worth another thread.
const ALONE: usize = 4096;

/// The tree over the records of `sorted`, in which every leaf has one record: any LBVH that is not collapsed. `costs` are those of
/// a step and of a test. [`Bvh2::collapsed`] finishes it: the header's costs are zero.
pub fn build<R: Record>(sorted: &Bvh2<R>, costs: &Collapse, leaves: Leaves) -> Bvh2<R> {
    let mut tree = sorted.without_nodes();
    let boxes: Vec<Aabb> = sorted.leaf_children().iter().map(Child::bounds).collect();
    let count = boxes.len();
    if count == 0 {
        return tree;
    }
    let mut buffers = [0, 1, 2].map(|axis| {
        let mut order: Vec<u32> = (0..count as u32).collect();
        let centroid = |i: u32| boxes[i as usize].centroid()[axis];
        order.par_sort_unstable_by(|&a, &b| centroid(a).total_cmp(&centroid(b)).then(a.cmp(&b)));
        (order, vec![0; count], vec![0.0; count])
    });
    let sweep = Sweep {
        scale: tree.header.area_scale,
        is_left: (0..count).map(|_| AtomicBool::new(false)).collect(),
        boxes,
        costs: *costs,
        leaves,
    };
    let axes = buffers.each_mut().map(|(order, spare, areas)| Axis { order, spare, areas });
    let slots = count - 1;
    tree.header.root = sweep.subtree(0, axes, &mut tree.nodes[..slots], 0);
    tree.header.inner_nodes = tree.nodes.iter().filter(|node| node.is_used()).count() as u32;
    let order = &buffers[0].0;
    tree.records[..count].copy_from_slice(&order.iter().map(|&i| sorted.records[i as usize]).collect::<Vec<_>>());
    tree
}

/// The primitives of a node in the order of their centroids along an axis, and room as large.
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
        let is_left = |i: u32| is_left[i as usize].load(Ordering::Relaxed);
        let (mut left, mut right) = (0, 0);
        for at in 0..self.order.len() {
            let i = self.order[at];
            if is_left(i) {
                self.order[left] = i;
                left += 1;
            } else {
                self.spare[right] = i;
                right += 1;
            }
        }
        self.order[left..].copy_from_slice(&self.spare[..right]);
    }
}

/// A split: its cost, how far it is from the middle, and how many primitives are on the left. The less the better.
type Split = (f32, usize, usize);

fn better(a: Split, b: Split) -> bool {
    (b.0, b.1) < (a.0, a.1)
}

struct Sweep {
    boxes: Vec<Aabb>,
    scale: f32,
    costs: Collapse,
    leaves: Leaves,
    /// Of each primitive, whether the last split has put it on the left.
    is_left: Vec<AtomicBool>,
}

impl Sweep {
    /// The subtree over the primitives of `axes`, whose records are from `first` on; `nodes` are the slots between them.
    fn subtree(&self, first: usize, mut axes: [Axis<'_>; 3], nodes: &mut [Node], depth: u32) -> Child {
        let count = axes[0].order.len();
        let bounds = axes[0].order.iter().fold(Aabb::EMPTY, |b, &i| b.union(&self.boxes[i as usize]));
        let leaf = Child { lo: bounds.lo, index: first as u32, hi: bounds.hi, count: count as u32 };
        if count == 1 {
            return leaf;
        }
        let (axis, (cost, _, left_count)) = self.best_split(&mut axes);
        let area = bounds.scaled_half_area(self.scale);
        if self.leaves == Leaves::Terminated
            && self.costs.leaf_cost(area, leaf.count) < self.costs.inner_cost(area, cost, 0.0)
        {
            return leaf;
        }
        let left_count = if depth >= HALVED_FROM { count / 2 } else { left_count };
        for (at, &i) in axes[axis].order.iter().enumerate() {
            self.is_left[i as usize].store(at < left_count, Ordering::Relaxed);
        }
        for other in (0..3).filter(|&other| other != axis) {
            axes[other].partition(&self.is_left);
        }
        let [(x0, x1), (y0, y1), (z0, z1)] = axes.map(|axis| axis.split_at(left_count));
        let (left_nodes, rest) = nodes.split_at_mut(left_count - 1);
        let (node, right_nodes) = rest.split_first_mut().expect("one slot fewer than primitives");
        let left = || self.subtree(first, [x0, y0, z0], left_nodes, depth + 1);
        let right = || self.subtree(first + left_count, [x1, y1, z1], right_nodes, depth + 1);
        let (left, right) = if count < ALONE { (left(), right()) } else { rayon::join(left, right) };
        *node = Node { children: [left, right] };
        Child { index: (first + left_count - 1) as u32, count: 0, ..leaf }
    }

    /// The best split and its axis; the first of equal axes.
    fn best_split(&self, axes: &mut [Axis<'_>; 3]) -> (usize, Split) {
        let [x, y, z] = axes;
        let splits = if x.order.len() < ALONE {
            [self.best_split_of(x), self.best_split_of(y), self.best_split_of(z)]
        } else {
            let of = |axis| self.best_split_of(axis);
            let (x, (y, z)) = rayon::join(|| of(x), || rayon::join(|| of(y), || of(z)));
            [x, y, z]
        };
        let first = (0, splits[0]);
        (1..3).fold(first, |best, axis| if better(best.1, splits[axis]) { (axis, splits[axis]) } else { best })
    }

    fn best_split_of(&self, axis: &mut Axis<'_>) -> Split {
        let count = axis.order.len();
        let mut right = Aabb::EMPTY;
        for at in (1..count).rev() {
            right = right.union(&self.boxes[axis.order[at] as usize]);
            axis.areas[at] = right.scaled_half_area(self.scale);
        }
        let mut best = (f32::INFINITY, usize::MAX, 1);
        let mut left = Aabb::EMPTY;
        for at in 1..count {
            left = left.union(&self.boxes[axis.order[at - 1] as usize]);
            let cost = self.costs.leaf_cost(left.scaled_half_area(self.scale), at as u32)
                + self.costs.leaf_cost(axis.areas[at], (count - at) as u32);
            let split = (cost, (2 * at).abs_diff(count), at);
            if better(best, split) {
                best = split;
            }
        }
        best
    }
}
