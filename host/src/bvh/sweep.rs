//! Full sweep: top-down, at each node the best by SAH of all splits of all three orders by centroid.
//!
//! Wald, Boulos, Shirley 2007, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies", section 3; Frantál 2019,
//! sections 2.3.1 and 3.3.1. The orders are sorted once, before the first split: whatever the split, what is on the left keeps its
//! order, and so does what is on the right. Slow, and what the quality of other builders is compared with.

use super::ALONE;
use super::bounds::Item;
use super::heuristic::split_cost::{Area, AxisSplits, First, Place, Side, SplitCost, growing};
use super::look_ahead::{LookAhead, Ranked};
use super::top_down::{self, Candidates, HALVED_FROM, LeafRule, divided_slots};
use super::topology::Topology;
use hedgerow::bvh::sah::Collapse;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// The tree over `items` by surface area, each counting for its weight. A node becomes a leaf where that is cheaper than its best
/// split; with `single` it never does. The order is of positions in `items`.
pub(super) fn positions(items: &[Item], costs: &Collapse, single: bool) -> Topology {
    positions_by(&Area, items, LeafRule { costs, single })
}

fn positions_by(by: &impl SplitCost, items: &[Item], rule: LeafRule<'_>) -> Topology {
    tree_over(items, rule, |sweep, whole| top_down::build(sweep, by, whole))
}

/// The tree over `items` by what splits a node with all of them.
fn tree_over<'a>(items: &'a [Item], rule: LeafRule<'a>, build: impl FnOnce(&Sweep<'a>, Part<'_>)) -> Topology {
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
    let sweep = Sweep { items, rule, is_left: (0..count).map(|_| AtomicBool::new(false)).collect() };
    let axes = buffers.each_mut().map(|(order, spare, weights)| Axis { order, spare, weights });
    build(&sweep, Part { axes, slots: &mut tree.splits });
    let [(order, ..), ..] = buffers;
    tree.order = order;
    tree
}

/// The tree over the primitives of `items`.
pub(super) fn build(by: &impl SplitCost, items: &[Item], rule: LeafRule<'_>) -> Topology {
    of_primitives(positions_by(by, items, rule), items)
}

/// The same by surface area, of whose splits at most `most` are judged at a node.
pub(super) fn build_ahead(items: &[Item], rule: LeafRule<'_>, most: u32) -> Topology {
    let ahead = |sweep: &Sweep<'_>, whole: Part<'_>| top_down::build(&LookAhead::new(sweep, rule, most), &Area, whole);
    let tree = tree_over(items, rule, ahead);
    of_primitives(tree, items)
}

/// A tree over primitives in place of positions in `items`.
fn of_primitives(mut tree: Topology, items: &[Item]) -> Topology {
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
    /// Of what is from a place on.
    weights: &'a mut [f32],
}

impl<'a> Axis<'a> {
    fn split_at(self, count: usize) -> (Axis<'a>, Axis<'a>) {
        let (left_order, order) = self.order.split_at_mut(count);
        let (left_spare, spare) = self.spare.split_at_mut(count);
        let (left_weights, weights) = self.weights.split_at_mut(count);
        (Axis { order: left_order, spare: left_spare, weights: left_weights }, Axis { order, spare, weights })
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

/// The items of a node, and where its subtree is written.
struct Part<'a> {
    axes: [Axis<'a>; 3],
    slots: &'a mut [u32],
}

/// In how many stretches an order is divided, of each of which one split is judged: neighbours differ by little.
const STRETCHES: usize = 16;

/// A split: its cost, how far it is from the middle, and how many items are on the left. The less the better.
type Split = (f32, usize, usize);

/// Stands for no split yet.
const NO_SPLIT: Split = (f32::INFINITY, usize::MAX, 1);

/// Puts the better one in the first one's place; of equal ones that one stays.
#[inline(always)]
fn improve(best: &mut Split, other: Split) -> bool {
    let is_better = (other.0, other.1) < (best.0, best.1);
    // A branch: it is seldom taken, and the next split need not wait for this one.
    if is_better {
        *best = other;
    }
    is_better
}

/// The best of all.
#[inline(always)]
fn best_of(splits: impl Iterator<Item = Split>) -> Split {
    let mut best = NO_SPLIT;
    splits.for_each(|split| {
        improve(&mut best, split);
    });
    best
}

struct Sweep<'a> {
    items: &'a [Item],
    rule: LeafRule<'a>,
    /// Of each item, whether the last split has put it on the left.
    is_left: Vec<AtomicBool>,
}

impl Candidates for Sweep<'_> {
    type Part<'a> = Part<'a>;
    /// An axis, and how many items are on the left.
    type Split = (usize, usize);

    fn count(&self, part: &Part<'_>) -> usize {
        part.axes[0].order.len()
    }

    fn best<C: SplitCost>(&self, by: &C, here: &C::Here, part: &mut Part<'_>, depth: u32) -> Option<(usize, usize)> {
        let (axis, (cost, _, left_count), whole) = self.best_split(by, here, &mut part.axes);
        if self.rule.is_leaf(by.of_node(here, &whole.bounds), whole.count, cost) {
            return None;
        }
        Some((axis, if depth >= HALVED_FROM { self.count(part) / 2 } else { left_count }))
    }

    fn sides(&self, by: &impl SplitCost, part: &Part<'_>, split: Option<&(usize, usize)>) -> [Side; 2] {
        let &(axis, left_count) = split.unwrap_or(&(0, self.count(part)));
        let (left, right) = part.axes[axis].order.split_at(left_count);
        [left, right].map(|order| order.iter().map(|&i| self.side(by, i)).fold(Side::EMPTY, Side::union))
    }

    fn members(&self, part: &Part<'_>, &(axis, left_count): &(usize, usize), each: &mut dyn FnMut(usize, u32)) {
        for (at, &i) in part.axes[axis].order.iter().enumerate() {
            each(usize::from(at >= left_count), self.items[i as usize].primitive());
        }
    }

    fn divide<'a>(
        &self,
        part: Self::Part<'a>,
        (axis, left_count): (usize, usize),
        first: First,
    ) -> [Self::Part<'a>; 2] {
        let Part { mut axes, slots } = part;
        for (at, &i) in axes[axis].order.iter().enumerate() {
            self.is_left[i as usize].store(at < left_count, Ordering::Relaxed);
        }
        for other in (0..3).filter(|&other| other != axis) {
            axes[other].partition(&self.is_left);
        }
        let counts = [left_count, axes[axis].order.len() - left_count];
        if first == First::Right {
            axes.iter_mut().for_each(|axis| axis.order.rotate_left(left_count));
        }
        let [left_count, _] = first.in_order(counts);
        let [left_slots, right_slots] = divided_slots(slots, left_count);
        let [(x0, x1), (y0, y1), (z0, z1)] = axes.map(|axis| axis.split_at(left_count));
        [Part { axes: [x0, y0, z0], slots: left_slots }, Part { axes: [x1, y1, z1], slots: right_slots }]
    }

    /// The first of the orders already is that of the leaves.
    fn end(&self, _part: Part<'_>) {}
}

impl Sweep<'_> {
    fn side(&self, by: &impl SplitCost, i: u32) -> Side {
        let item = &self.items[i as usize];
        Side::of(item, by.is_seen(item))
    }

    /// What is found along each axis, by several threads if there are many items.
    fn along_axes<T: Send>(axes: &mut [Axis<'_>; 3], of: impl Fn(&mut Axis<'_>) -> T + Sync) -> [T; 3] {
        let [x, y, z] = axes;
        if x.order.len() < ALONE {
            return [of(x), of(y), of(z)];
        }
        let (x, (y, z)) = rayon::join(|| of(x), || rayon::join(|| of(y), || of(z)));
        [x, y, z]
    }

    /// The best split and its axis, the first of equal axes; and all items.
    fn best_split<C: SplitCost>(&self, by: &C, here: &C::Here, axes: &mut [Axis<'_>; 3]) -> (usize, Split, Side) {
        let [x, y, z] = Self::along_axes(axes, |axis| self.best_split_of(by, here, axis));
        let (mut axis, mut best) = (0, x.0);
        for (other, split) in [(1, y.0), (2, z.0)] {
            if improve(&mut best, split) {
                axis = other;
            }
        }
        (axis, best, x.1)
    }

    fn best_split_of<C: SplitCost>(&self, by: &C, here: &C::Here, axis: &mut Axis<'_>) -> (Split, Side) {
        if C::BY_BOTH {
            return self.best_split_by_both(by, here, axis.order);
        }
        let (splits, whole) = self.splits(by, here, axis);
        (best_of(splits), whole)
    }

    /// The same by a heuristic whose sides cost something together alone.
    fn best_split_by_both<C: SplitCost>(&self, by: &C, here: &C::Here, order: &[u32]) -> (Split, Side) {
        let side = |&i: &u32| self.side(by, i);
        let lefts: Vec<Side> = growing(order.iter().map(side)).collect();
        let mut rights: Vec<Side> = growing(order[1..].iter().rev().map(side)).collect();
        rights.reverse();
        let (&whole, lefts) = lefts.split_last().expect("a node has items");
        let place = |(at, &i): (usize, &u32)| {
            let primitive = self.items[i as usize].primitive();
            Place { primitive, first: at, last: at }
        };
        let splits = AxisSplits { lefts, rights: &rights };
        let costs = by.of_splits(here, &splits, order.iter().enumerate().map(place), self.rule.costs);
        let of = |(cost, at): (f32, usize)| (cost, (2 * at).abs_diff(order.len()), at);
        (best_of(costs.into_iter().zip(1..).map(of)), whole)
    }

    /// All splits along an axis, and all items.
    #[inline(always)]
    fn splits<'s, C: SplitCost>(
        &'s self,
        by: &'s C,
        here: &'s C::Here,
        axis: &'s mut Axis<'_>,
    ) -> (impl Iterator<Item = Split>, Side) {
        let count = axis.order.len();
        let side = |&i: &u32| self.side(by, i);
        let mut whole = Side::EMPTY;
        let from_right = by.of_sides(here, growing(axis.order.iter().rev().map(side)));
        for ((weight, side), place) in from_right.zip(axis.weights.iter_mut().rev()) {
            (*place, whole) = (weight, side);
        }
        let (costs, weights) = (self.rule.costs, &*axis.weights);
        let from_left = by.of_sides(here, growing(axis.order[..count - 1].iter().map(side)));
        let splits = from_left.zip(&weights[1..]).zip(1_usize..).map(move |(((weight, left), &right_weight), at)| {
            let cost = costs.leaf_cost(weight, left.count) + costs.leaf_cost(right_weight, whole.count - left.count);
            (cost, (2 * at).abs_diff(count), at)
        });
        (splits, whole)
    }
}

impl Ranked for Sweep<'_> {
    /// One of each stretch.
    fn cheapest(&self, part: &mut Part<'_>, depth: u32, most: usize) -> Vec<(usize, usize)> {
        let count = Candidates::count(self, part);
        let of_axes = Self::along_axes(&mut part.axes, |axis| {
            let (splits, whole) = self.splits(&Area, &(), axis);
            let mut best = [NO_SPLIT; STRETCHES];
            for split in splits {
                improve(&mut best[split.2 * STRETCHES / count], split);
            }
            (best, whole)
        });
        let whole = of_axes[0].1;
        let numbered = |(axis, (best, _)): (usize, ([Split; STRETCHES], Side))| best.map(|split: Split| (axis, split));
        let mut all: Vec<(usize, Split)> = (0..).zip(of_axes).flat_map(numbered).collect();
        all.retain(|(_, (cost, ..))| *cost < f32::INFINITY);
        all.sort_by(|(_, a), (_, b)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        match all.first() {
            Some(&(_, (cost, ..))) if depth < HALVED_FROM => {
                if self.rule.is_leaf(whole.bounds.half_area(), whole.count, cost) {
                    return Vec::new();
                }
                all.iter().take(most).map(|&(axis, (.., left_count))| (axis, left_count)).collect()
            }
            _ => self.best(&Area, &(), part, depth).into_iter().collect(),
        }
    }

    fn copies(&self, part: &Part<'_>, &(axis, left_count): &(usize, usize)) -> [Vec<Item>; 2] {
        let (left, right) = part.axes[axis].order.split_at(left_count);
        [left, right].map(|order| order.iter().map(|&i| self.items[i as usize]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::bounds::tests::boxes;
    use crate::bvh::bounds::{Bounds, around};
    use crate::bvh::topology::LEAF;

    /// The same, plainly: every split of every node is tried, with boxes made anew.
    fn plain(items: &[Item], rule: LeafRule<'_>, tree: &mut Topology) {
        let sorted = |axis: usize| {
            let mut items = items.to_vec();
            items.sort_by(|a, b| {
                a.centroid_on(axis).total_cmp(&b.centroid_on(axis)).then(a.primitive().cmp(&b.primitive()))
            });
            items
        };
        let cost = |side: &[Item]| rule.costs.leaf_cost(around(side).half_area(), weight(side));
        let split = |axis: usize| {
            let items = sorted(axis);
            let of =
                move |at: usize| (cost(&items[..at]) + cost(&items[at..]), (2 * at).abs_diff(items.len()), axis, at);
            (1..sorted(axis).len()).map(of).collect::<Vec<_>>()
        };
        let all = (0..3).flat_map(split);
        // Of equal ones the first.
        let best = all.reduce(|best, split| if (split.0, split.1) < (best.0, best.1) { split } else { best });
        let is_split = best.is_some_and(|best| !rule.is_leaf(around(items).half_area(), weight(items), best.0));
        let Some((_, _, axis, at)) = best.filter(|_| is_split) else {
            tree.splits.extend(items.iter().skip(1).map(|_| LEAF));
            return tree.order.extend(sorted(0).iter().map(Item::primitive));
        };
        tree.splits.push(at as u32);
        let items = sorted(axis);
        plain(&items[..at], rule, tree);
        plain(&items[at..], rule, tree);
    }

    fn weight(items: &[Item]) -> u32 {
        items.iter().map(Item::weight).sum()
    }

    #[test]
    fn a_sweep_takes_the_best_of_all_splits_at_every_node() {
        for count in [1, 2, 3, 20, 150, 400] {
            // Some of them count twice, as in the top of a bonsai.
            let twice = |item: Item| Item::new(item.bounds(), item.primitive(), 1 + item.primitive() % 5 / 4);
            for items in [boxes(count), boxes(count).into_iter().map(twice).collect()] {
                for single in [false, true] {
                    let rule = LeafRule { costs: &Collapse::SAH, single };
                    let mut expected = Topology { order: Vec::new(), splits: Vec::new() };
                    plain(&items, rule, &mut expected);
                    let found = build(&Area, &items, rule);
                    assert_eq!(found.splits, expected.splits, "{count} boxes, {single}");
                    assert_eq!(found.order, expected.order, "{count} boxes, {single}");
                }
            }
        }
    }

    #[test]
    fn boxes_in_one_place_are_halved() {
        let one = Bounds { lo: glam::Vec3A::ZERO, hi: glam::Vec3A::ONE };
        let items: Vec<Item> = (0..64).map(|i| Item::new(one, i, 1)).collect();
        let tree = build(&Area, &items, LeafRule { costs: &Collapse::SAH, single: true });
        assert_eq!((tree.splits[0], tree.splits[1], tree.splits[32]), (32, 16, 16));
    }
}
