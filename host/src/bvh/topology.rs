//! A binary tree without boxes: an order of the primitives, and how each subtree divides its part of it.
//!
//! All builders of this crate make one; `finish` makes a [`Bvh2`](hedgerow::bvh::layout::Bvh2) of it. Slots are in depth-first
//! order, the left child first, and a subtree of n primitives has n − 1 of them, whether it uses them or not. So the left child
//! of slot s is at s + 1 and the right one at s + (primitives on the left), and any two subtrees can be written at once.

use super::{ALONE, DIVIDED_ABOVE};
use hedgerow::bvh::layout::{Bvh2, Record};
use rayon::prelude::*;
use std::ops::Range;

/// In a slot: all primitives of the subtree are in one leaf.
pub(crate) const LEAF: u32 = 0;

/// A subtree: its slot, if it has more than one primitive, and its primitives.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    pub slot: u32,
    pub first: u32,
    pub count: u32,
}

impl Span {
    /// The whole of a tree over `count` primitives.
    pub fn whole(count: usize) -> Span {
        Span { slot: 0, first: 0, count: count as u32 }
    }

    /// Both children, of which the left one has `left_count` primitives.
    pub fn children(self, left_count: u32) -> [Span; 2] {
        let Span { slot, first, count } = self;
        [
            Span { slot: slot + 1, first, count: left_count },
            Span { slot: slot + left_count, first: first + left_count, count: count - left_count },
        ]
    }

    /// Where its primitives are in the order.
    pub fn primitives(self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }

    /// Its slots.
    pub fn slots(self) -> Range<usize> {
        self.slot as usize..(self.slot + self.count) as usize - 1
    }
}

/// A merge of a builder that goes bottom-up over primitives in an order. A subtree is known by its *representative*, the first of
/// its places in that order; the left of two that merge is the one with the smaller representative, which becomes that of both.
/// The merge may be kept at the representative of the right one, where no other can be.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Merge {
    /// Where the left one's last merge is kept; of a single primitive, its place.
    pub left: u32,
    /// The same of the right one. Of a representative that is not merged into another yet, what is known of its own subtree.
    pub right: u32,
    /// How many primitives the left one has.
    pub left_count: u32,
}

impl Merge {
    /// Those of single primitives that wait to be merged.
    pub fn none(count: usize) -> Vec<Merge> {
        (0..count as u32)
            .into_par_iter()
            .with_min_len(ALONE)
            .map(|place| Merge { left: 0, right: place, left_count: 0 })
            .collect()
    }

    /// Merges the subtrees of two representatives, the smaller one first, in what is known of the places from `first` on.
    #[inline]
    pub fn record(merges: &mut [Merge], [left, right]: [u32; 2], left_count: u32, first: u32) {
        let of_left = &mut merges[(left - first) as usize];
        let root = std::mem::replace(&mut of_left.right, right);
        let of_right = &mut merges[(right - first) as usize];
        (of_right.left, of_right.left_count) = (root, left_count);
    }
}

/// A binary tree over primitives.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Topology {
    /// The primitives from left to right.
    pub order: Vec<u32>,
    /// In each slot, how many primitives its left subtree has, or [`LEAF`]. One slot fewer than primitives.
    pub splits: Vec<u32>,
}

impl Topology {
    /// A tree of one leaf over `count` primitives, for a builder to fill in.
    pub fn new(count: usize) -> Topology {
        Topology { order: vec![0; count], splits: vec![LEAF; count.saturating_sub(1)] }
    }

    /// That of a tree. Its leaves stay what they are.
    pub fn of_tree<R: Record>(tree: &Bvh2<R>) -> Topology {
        let count = tree.header.active as usize;
        let mut topology = Topology { order: Vec::with_capacity(count), splits: Vec::with_capacity(count) };
        let mut next = Vec::new();
        if count > 0 {
            next.push((tree.header.root, None));
        }
        // The right child comes when the left one is done, and tells the parent how many primitives that had.
        while let Some((child, parent)) = next.pop() {
            if let Some((slot, first)) = parent {
                topology.splits[slot] = (topology.order.len() - first) as u32;
            }
            if child.is_leaf() {
                let records = &tree.records[child.index as usize..(child.index + child.count) as usize];
                topology.order.extend(records.iter().map(Record::primitive));
                topology.splits.extend(records.iter().skip(1).map(|_| LEAF));
            } else {
                let [left, right] = tree.nodes[child.index as usize].children;
                next.push((right, Some((topology.splits.len(), topology.order.len()))));
                next.push((left, None));
                topology.splits.push(LEAF);
            }
        }
        topology
    }

    /// The tree over `count` primitives that merges have made. `root` is where the last one is kept; of a single primitive, here and
    /// in what merges name, its place.
    pub fn of_merges(count: usize, merges: &[Merge], root: u32, primitive: impl Fn(u32) -> u32 + Sync) -> Topology {
        let mut tree = Topology::new(count);
        if count > 0 {
            let whole = MergedSubtree { root, order: &mut tree.order, splits: &mut tree.splits };
            whole.fill(merges, &primitive, 0);
        }
        tree
    }

    /// The tree of merges that are kept by representatives. The one at the first place, which is no right one's, knows the root.
    pub fn of_representatives(merges: &[Merge], primitive: impl Fn(u32) -> u32 + Sync) -> Topology {
        Topology::of_merges(merges.len(), merges, merges.first().map_or(0, |first| first.right), primitive)
    }

    /// The same with a subtree in the place of each of its leaves, of which each has one number. `counts` says how many primitives
    /// the subtree of a number has, `append` puts it behind a tree.
    pub fn expanded(&self, counts: &[u32], append: impl Fn(&mut Topology, u32)) -> Topology {
        // How many primitives are to the left of each leaf.
        let mut before = vec![0];
        before.extend(self.order.iter().scan(0, |sum, &number| {
            *sum += counts[number as usize];
            Some(*sum)
        }));
        let count = before[self.order.len()] as usize;
        let mut tree = Topology { order: Vec::with_capacity(count), splits: Vec::with_capacity(count) };
        let mut next = vec![Span::whole(self.order.len())];
        while let Some(span) = next.pop().filter(|span| span.count > 0) {
            if span.count == 1 {
                append(&mut tree, self.order[span.first as usize]);
                continue;
            }
            let children = span.children(self.splits[span.slot as usize]);
            let left = children[0].primitives();
            tree.splits.push(before[left.end] - before[left.start]);
            next.extend(children.into_iter().rev());
        }
        tree
    }
}

/// A subtree of a tree of merges, and its part of a topology.
struct MergedSubtree<'a> {
    root: u32,
    order: &'a mut [u32],
    splits: &'a mut [u32],
}

impl MergedSubtree<'_> {
    fn fill(self, merges: &[Merge], primitive: &(impl Fn(u32) -> u32 + Sync), depth: u32) {
        let MergedSubtree { root, order, splits } = self;
        if order.len() < ALONE || depth >= DIVIDED_ABOVE {
            return MergedSubtree { root, order, splits }.fill_alone(merges, primitive);
        }
        let Merge { left, right, left_count } = merges[root as usize];
        let (split, splits) = splits.split_first_mut().expect("a subtree of two primitives has a slot");
        *split = left_count;
        let (left_order, right_order) = order.split_at_mut(left_count as usize);
        let (left_splits, right_splits) = splits.split_at_mut(left_count as usize - 1);
        let left = MergedSubtree { root: left, order: left_order, splits: left_splits };
        let right = MergedSubtree { root: right, order: right_order, splits: right_splits };
        rayon::join(|| left.fill(merges, primitive, depth + 1), || right.fill(merges, primitive, depth + 1));
    }

    /// The same by one thread, however deep the subtree is.
    fn fill_alone(self, merges: &[Merge], primitive: &impl Fn(u32) -> u32) {
        let MergedSubtree { root, order, splits } = self;
        let (mut order_at, mut splits_at) = (0, 0);
        let mut next = vec![(root, order.len() as u32)];
        while let Some((root, count)) = next.pop() {
            if count == 1 {
                order[order_at] = primitive(root);
                order_at += 1;
            } else {
                let Merge { left, right, left_count } = merges[root as usize];
                splits[splits_at] = left_count;
                splits_at += 1;
                next.push((right, count - left_count));
                next.push((left, left_count));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merges_in_any_order_give_slots_depth_first() {
        // ((3, 1), (0, (4, 2)))
        let merges = [([4, 2], 1), ([3, 1], 1), ([0, 0], 1), ([1, 2], 2)];
        let merges = merges.map(|([left, right], left_count)| Merge { left, right, left_count });
        let tree = Topology::of_merges(5, &merges, 3, |place| place);
        assert_eq!(tree, Topology { order: vec![3, 1, 0, 4, 2], splits: vec![2, 1, 1, 1] });
        assert_eq!(Topology::of_merges(1, &[], 0, |place| place), Topology::new(1));
        assert_eq!(Topology::of_merges(0, &[], 0, |place| place), Topology::new(0));
    }

    #[test]
    fn merges_by_representatives_give_the_same() {
        let mut merges = Merge::none(5);
        // Places 0 and 1 merge, then 3 and 4, then 2 and those, then all.
        for (pair, left_count) in [([0, 1], 1), ([3, 4], 1), ([2, 3], 1), ([0, 2], 2)] {
            Merge::record(&mut merges, pair, left_count, 0);
        }
        let tree = Topology::of_representatives(&merges, |place| place + 10);
        assert_eq!(tree, Topology { order: vec![10, 11, 12, 13, 14], splits: vec![2, 1, 1, 1] });
        for count in [0, 1] {
            assert_eq!(Topology::of_representatives(&Merge::none(count), |place| place), Topology::new(count));
        }
    }

    #[test]
    fn a_chain_of_merges_does_not_overflow_the_stack() {
        let count = 200_000;
        let mut merges = Merge::none(count);
        for right in 1..count as u32 {
            Merge::record(&mut merges, [0, right], right, 0);
        }
        let tree = Topology::of_representatives(&merges, |place| place);
        assert!(tree.order.iter().zip(0..).all(|(&primitive, i)| primitive == i));
        assert!(tree.splits.iter().rev().zip(1..).all(|(&split, count)| split == count));
    }
}
