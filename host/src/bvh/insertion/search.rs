//! The best place for a subtree: branch and bound, by what its box makes the nodes above the place grow.
//!
//! Putting a subtree with the box L beside one with the box X costs the area of the new node, SA(L ∪ X), and *induces* the growth
//! of all nodes above: the sum of SA(A ∪ L) − SA(A). What is induced only grows on the way down, and no new node is smaller than L:
//! where what is induced and SA(L) come to more than the best place known, nothing below need be looked at. Subtrees wait in a
//! queue, those with the least induced first.
//!
//! Of places that cost the same the one above the fewest primitives is taken, but all that have no more than the subtree itself are
//! alike. Otherwise the first of thousands of equal boxes would always be the root, and the tree a chain; or large subtrees would
//! hang beside leaves. So the search goes on where the bound equals the best cost, until it has found a place as light as the
//! subtree. It tries the child of fewer primitives first: equal boxes then take a walk down, and make a balanced tree.
//!
//! Rounding changes none of this: sums of floats and areas of larger boxes never become smaller.

use super::{InsertionTree, Link, ROOT};
use crate::bvh::bounds::{Item, half_areas};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What a search keeps from one to the next: room.
#[derive(Debug, Default)]
pub(in super::super) struct Search {
    /// Nodes to look into that nothing is induced above: many, near the root. The last one first.
    free_of_cost: Vec<u32>,
    /// The others: bits of what is induced above, which are in the order of floats that are not negative, and the node.
    others: BinaryHeap<Reverse<u64>>,
}

/// A place for a subtree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub cost: f32,
    /// How many primitives are below, and at least as many as the subtree has.
    pub weight: u32,
    pub link: Link,
}

impl Place {
    /// Whether there may be a better one for a subtree of `own` primitives where no place costs less than `bound`.
    #[inline(always)]
    fn may_be_beaten_by(&self, bound: f32, own: u32) -> bool {
        bound < self.cost || (bound == self.cost && self.weight > own)
    }

    #[inline(always)]
    fn take_better(&mut self, cost: f32, weight: u32, link: Link) {
        if cost < self.cost || (cost == self.cost && weight < self.weight) {
            *self = Place { cost, weight, link };
        }
    }
}

impl Search {
    /// Where in a tree that is not empty a subtree costs least.
    pub fn best_link(&mut self, tree: &InsertionTree, item: &Item) -> Link {
        self.best_place(tree, item, ROOT).link
    }

    /// Where a subtree costs least, if that is less than `limit`.
    pub fn best_link_within(&mut self, tree: &InsertionTree, item: &Item, limit: f32) -> Option<(Link, f32)> {
        let place = self.search(tree, item, ROOT, limit);
        (place.cost < limit).then_some((place.link, place.cost))
    }

    /// The same of a part of the tree. Nothing is put beside a subtree that this one does not hang in.
    pub fn best_link_below(&mut self, tree: &InsertionTree, item: &Item, top: Link) -> Link {
        self.best_place(tree, item, top).link
    }

    /// The best of all places at `top` and below; the costs are those of a tree that has its root there.
    pub(super) fn best_place(&mut self, tree: &InsertionTree, item: &Item, top: Link) -> Place {
        self.search(tree, item, top, f32::INFINITY)
    }

    fn search(&mut self, tree: &InsertionTree, item: &Item, top: Link, limit: f32) -> Place {
        let bounds = item.bounds();
        let (area, own) = (bounds.half_area(), item.weight());
        let at_top = tree.at(top);
        let cost = at_top.bounds().union(bounds).half_area();
        let mut best = Place { cost, weight: at_top.weight().max(own), link: top };
        if cost >= limit {
            // No place, and none that costs as much is better.
            best = Place { cost: limit, weight: 0, link: top };
        }
        if at_top.weight() < 2 {
            return best;
        }
        self.put_off(at_top.primitive(), cost - at_top.bounds().half_area());
        while let Some((node, induced)) = self.next() {
            if !best.may_be_beaten_by(induced + area, own) {
                // Nor is anything that waits better.
                break;
            }
            let [left, right] = tree.children_of(node);
            let [of_left, of_right] = [left.bounds(), right.bounds()];
            let areas = half_areas([of_left.union(bounds), of_right.union(bounds), of_left, of_right]);
            let costs = [induced + areas.x, induced + areas.y];
            best.take_better(costs[0], left.weight().max(own), 2 * node);
            best.take_better(costs[1], right.weight().max(own), 2 * node + 1);
            // The sum is of the growth, not of the areas: it is never less than what is induced above.
            let below = [(left, induced + (areas.x - areas.z)), (right, induced + (areas.y - areas.w))];
            let [first, second] = if left.weight() < right.weight() { [below[1], below[0]] } else { below };
            for (child, induced) in [first, second] {
                if child.weight() > 1 && best.may_be_beaten_by(induced + area, own) {
                    self.put_off(child.primitive(), induced);
                }
            }
        }
        self.free_of_cost.clear();
        self.others.clear();
        best
    }

    #[inline(always)]
    fn put_off(&mut self, node: u32, induced: f32) {
        if induced == 0.0 {
            self.free_of_cost.push(node);
        } else {
            self.others.push(Reverse(u64::from(induced.to_bits()) << 32 | u64::from(node)));
        }
    }

    #[inline(always)]
    fn next(&mut self) -> Option<(u32, f32)> {
        if let Some(node) = self.free_of_cost.pop() {
            return Some((node, 0.0));
        }
        let Reverse(key) = self.others.pop()?;
        Some((key as u32, f32::from_bits((key >> 32) as u32)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::swept;
    use super::*;
    use crate::bvh::bounds::{Bounds, tests::boxes};
    use glam::Vec3A;

    /// Every place in the tree.
    fn places(tree: &InsertionTree, item: &Item) -> Vec<Place> {
        let bounds = item.bounds();
        let mut places = Vec::new();
        let mut next = vec![(ROOT, 0.0)];
        while let Some((link, induced)) = next.pop() {
            let at = tree.at(link);
            let area = at.bounds().union(bounds).half_area();
            places.push(Place { cost: induced + area, weight: at.weight().max(item.weight()), link });
            if at.weight() > 1 {
                let below = induced + (area - at.bounds().half_area());
                next.extend([0, 1].map(|side| (2 * at.primitive() + side, below)));
            }
        }
        places
    }

    #[test]
    fn the_best_place_is_that_of_all_places() {
        let mut search = Search::default();
        for count in [1, 2, 3, 50, 200] {
            let items = boxes(count + 50);
            let tree = swept(&items[..count as usize]);
            let whole = Item::new(Bounds { lo: Vec3A::splat(-1.0), hi: Vec3A::splat(2.0) }, 0, 1);
            let point = Item::new(Bounds::point(Vec3A::splat(0.5)), 0, 1);
            for item in items.iter().chain([&whole, &point]) {
                let found = search.best_place(&tree, item, ROOT);
                let all = places(&tree, item);
                assert_eq!(all.len(), 2 * count as usize - 1);
                let key = |place: &Place| (place.cost.to_bits(), place.weight);
                assert_eq!(Some(key(&found)), all.iter().map(key).min(), "{count}: {:?}", item.bounds());
                assert!(all.contains(&found));
            }
        }
    }
}
