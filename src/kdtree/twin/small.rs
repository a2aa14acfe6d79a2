//! Subtrees of few references, to their leaves: every face of every box is looked at, and all boxes for each of them.
//!
//! That takes time by the square, and no sorting: what a subgroup of a device does fastest. The nodes of such a subtree lie
//! together, depth first, as one subgroup writes them.

use super::Subtree;
use super::clip::{KdPlane, KdReference, divided};
use super::heuristic::{Heuristic, KdSplit};
use crate::bvh::layout::Triangle;
use crate::geometry::Aabb;
use crate::kdtree::layout::halves;

/// Nodes that a subtree may have below its root. Cells become leaves rather than have more: no tree of the scenes measured does.
pub const MOST_NODES: u32 = 254;

/// A subtree that is being built.
pub struct Small<'a> {
    heuristic: &'a Heuristic,
    /// The records, and what of them has no room.
    records: (&'a [Triangle], f32),
    nodes: u32,
}

impl<'a> Small<'a> {
    pub fn new(heuristic: &'a Heuristic, records: (&'a [Triangle], f32)) -> Small<'a> {
        Small { heuristic, records, nodes: 0 }
    }

    /// The tree over a few references in `cell`.
    pub fn tree(mut self, cell: Aabb, references: Vec<KdReference>, depth: u32) -> Subtree {
        Subtree::Together(Box::new(self.subtree(cell, references, depth)))
    }

    fn subtree(&mut self, cell: Aabb, references: Vec<KdReference>, depth: u32) -> Subtree {
        let count = references.len();
        if references.is_empty() || self.heuristic.is_leaf(count, depth) || self.nodes + 2 > MOST_NODES {
            return Subtree::leaf(&references);
        }
        let best = self.best_split(&cell, &references);
        let Some(KdSplit { plane, .. }) = self.heuristic.paying(best, &cell, count) else {
            return Subtree::leaf(&references);
        };
        let halves = halves(&cell, plane.axis, plane.at);
        let [left, right] = self.parts(&references, &plane, &halves);
        self.nodes += [&left, &right].map(|part| u32::from(!part.is_empty())).iter().sum::<u32>();
        let [left_cell, right_cell] = halves;
        let left = self.subtree(left_cell, left, depth + 1);
        let right = self.subtree(right_cell, right, depth + 1);
        Subtree::Inner { plane, children: Box::new([left, right]) }
    }

    /// The cheapest plane of all axes; of equal ones that of the first axis, and there the leftmost.
    fn best_split(&self, cell: &Aabb, references: &[KdReference]) -> Option<KdSplit> {
        let mut best: Option<KdSplit> = None;
        for axis in 0..3 {
            let mut best_of_axis: Option<KdSplit> = None;
            for at in references.iter().flat_map(|r| [r.bounds.lo[axis], r.bounds.hi[axis]]) {
                let count = |is: &dyn Fn(f32, f32) -> bool| {
                    references.iter().filter(|r| is(r.bounds.lo[axis], r.bounds.hi[axis])).count() as u32
                };
                let (left, right) = (count(&|lo, _| lo < at), count(&|_, hi| hi > at));
                let planar = count(&|lo, hi| lo == at && hi == at);
                let Some(split) = self.heuristic.split(cell, (axis, at), [left, planar, right]) else { continue };
                let is_better = best_of_axis.is_none_or(|b| (split.cost, split.plane.at) < (b.cost, b.plane.at));
                if is_better {
                    best_of_axis = Some(split);
                }
            }
            best = KdSplit::better(best, best_of_axis);
        }
        best
    }

    fn parts(&self, references: &[KdReference], plane: &KdPlane, halves: &[Aabb; 2]) -> [Vec<KdReference>; 2] {
        let mut parts = [Vec::new(), Vec::new()];
        for reference in references {
            let divided = divided(reference, self.records, plane, halves);
            parts.iter_mut().zip(divided).for_each(|(part, reference)| part.extend(reference));
        }
        parts
    }
}
