//! Insertion-based optimisation: nodes are taken out of a finished tree, and their children put in where they cost least.
//!
//! Bittner, Hapala, Havran 2013, section 3; Frantál 2019, section 3.4. In an iteration 1% of the inner nodes are taken out, the
//! worst first as they are at its beginning. The cost goes up and down on the way, so it is looked at every ten iterations only.
//! When it has not fallen, nodes are chosen at random instead, until five such iterations gain nothing either.
//!
//! Three things differ from the thesis:
//!
//! - The cost is that of the tree once it is collapsed, which is what the build ends with. The best tree that was seen is the
//!   result, not the last: it never costs more than the tree that came in.
//! - Nodes that are chosen at random come from a shuffled list of all, so that none comes twice before each came once.
//! - They are put back as they were unless the sum of all areas shrinks. A good tree is only made worse without this: that of a
//!   sweep over the dragon costs 0.3% more after ten iterations by measure, and takes more than a hundred to be as good again.
//!   A bad tree gains faster without.

use super::{InsertionOptions, InsertionTree, Search, Selection, part_of};
use crate::bvh::bounds::Item;
use crate::bvh::topology::Topology;
use hedgerow::bvh::layout::MAX_DEPTH;
use hedgerow::bvh::sah::Collapse;

/// A tree that costs no more than this one does. `items` are its primitives from left to right.
pub(in super::super) fn optimise(
    topology: Topology,
    items: &[Item],
    costs: &Collapse,
    options: &InsertionOptions,
) -> Topology {
    let tree = InsertionTree::of_topology(&topology, items);
    let inner = tree.room();
    if inner < 2 {
        return topology;
    }
    let mut audit = Audit::default();
    let least = audit.cost(&tree, costs);
    let mut best = Best { costs, audit, tree: tree.clone(), least, least_gain: options.least_gain };
    let wanted = part_of(inner, options.fraction);
    let mut search = Search::default();

    let (mut by_measure, mut selection) = (tree, Selection::default());
    best.look_every(options.patience, options.most, &mut by_measure, |tree| {
        for node in selection.worst(tree, options.measure, wanted) {
            reinsert(tree, node, &mut search);
        }
    });

    let mut at_random = by_measure;
    at_random.clone_from(&best.tree);
    let mut nodes: Vec<u32> = (0..inner as u32).collect();
    shuffle(&mut nodes);
    let mut nodes = nodes.iter().cycle();
    best.look_every(options.random_patience, options.most, &mut at_random, |tree| {
        for &node in nodes.by_ref().take(wanted) {
            reinsert_for_gain(tree, node, &mut search);
        }
    });
    best.tree.topology()
}

/// The best tree that was seen.
struct Best<'a> {
    costs: &'a Collapse,
    audit: Audit,
    tree: InsertionTree,
    least: f64,
    least_gain: f32,
}

impl Best<'_> {
    /// Iterates and looks at the cost each time that `patience` iterations are done, until it has not fallen enough. At most `most`
    /// iterations.
    fn look_every(
        &mut self,
        patience: u32,
        most: u32,
        tree: &mut InsertionTree,
        mut iteration: impl FnMut(&mut InsertionTree),
    ) {
        let mut left = if patience == 0 { 0 } else { most };
        while left > 0 {
            let iterations = patience.min(left);
            left -= iterations;
            (0..iterations).for_each(|_| iteration(tree));
            let (cost, before) = (self.audit.cost(tree, self.costs), self.least);
            if cost < before {
                self.tree.clone_from(tree);
                self.least = cost;
            }
            if cost >= before * (1.0 - f64::from(self.least_gain)) {
                break;
            }
        }
    }
}

/// Takes a node out and puts its children where they cost least, the larger one first.
pub(in super::super) fn reinsert(tree: &mut InsertionTree, node: u32, search: &mut Search) {
    let Some(taken) = tree.take_out(node) else { return };
    for (child, free) in taken.larger_first().into_iter().zip(taken.free) {
        let link = search.best_link(tree, &child);
        tree.put_in(child, link, free);
    }
}

/// The same where the sum of all areas shrinks by it; otherwise the tree stays as it is.
fn reinsert_for_gain(tree: &mut InsertionTree, node: u32, search: &mut Search) {
    let Some(taken) = tree.take_out(node) else { return };
    let [first, second] = taken.larger_first();
    let [first_free, second_free] = taken.free;
    // What the first may cost, given that the second costs its own area at least.
    let limit = taken.gain - second.bounds().half_area();
    let Some((link, cost)) = search.best_link_within(tree, &first, limit) else { return tree.put_back(&taken) };
    tree.put_in(first, link, first_free);
    match search.best_link_within(tree, &second, taken.gain - cost) {
        Some((link, _)) => tree.put_in(second, link, second_free),
        None => {
            tree.pull_out(link, first_free);
            tree.put_back(&taken);
        }
    }
}

/// Brings them into an order that looks random and is always the same (Fisher and Yates).
pub(in super::super) fn shuffle<T>(all: &mut [T]) {
    for last in (1..all.len()).rev() {
        all.swap(last, draw(last as u64, last + 1));
    }
}

/// A number below `count` that looks like a random one: SplitMix64 of `number` (Steele, Lea, Flood 2014).
fn draw(number: u64, count: usize) -> usize {
    let mut x = number.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ x >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ x >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((u128::from(x ^ x >> 31) * count as u128) >> 64) as usize
}

/// A subtree in the order of slots of a [`Topology`].
#[derive(Debug, Clone, Copy)]
struct Slot {
    area: f32,
    /// The place of its first leaf.
    first: u32,
    count: u32,
    left_count: u32,
    depth: u32,
}

/// What trees cost, and room for finding it.
#[derive(Debug, Default)]
struct Audit {
    next: Vec<(Item, u32)>,
    slots: Vec<Slot>,
    leaf_areas: Vec<f32>,
    /// Of each slot the cost that collapsing decides by, and the same in double precision.
    costs: Vec<(f32, f64)>,
}

impl Audit {
    /// The cost of a tree once it is collapsed, by the rule of `finish.rs`.
    fn cost(&mut self, tree: &InsertionTree, costs: &Collapse) -> f64 {
        let Audit { next, slots, leaf_areas, costs: known } = self;
        slots.clear();
        leaf_areas.clear();
        next.push((*tree.at(super::ROOT), 0));
        while let Some((item, depth)) = next.pop() {
            let area = item.bounds().half_area();
            let Some([left, right]) = tree.children(&item) else {
                leaf_areas.push(area);
                continue;
            };
            let (first, count, left_count) = (leaf_areas.len() as u32, item.weight(), left.weight());
            slots.push(Slot { area, first, count, left_count, depth });
            next.extend([(*right, depth + 1), (*left, depth + 1)]);
        }
        let leaf =
            |area, count| (costs.leaf_cost(area, count), f64::from(costs.c_i) * f64::from(area) * f64::from(count));
        known.resize(slots.len(), (0.0, 0.0));
        for (slot, &Slot { area, first, count, left_count, depth }) in slots.iter().enumerate().rev() {
            let child = |slot: usize, first: u32, count: u32| match count {
                1 => leaf(leaf_areas[first as usize], 1),
                _ => known[slot],
            };
            let left = child(slot + 1, first, left_count);
            let right = child(slot + left_count as usize, first + left_count, count - left_count);
            let as_leaf = leaf(area, count);
            let as_inner =
                (costs.inner_cost(area, left.0, right.0), f64::from(costs.c_t) * f64::from(area) + (left.1 + right.1));
            let is_leaf = depth >= MAX_DEPTH || (costs.enabled && as_leaf.0 < as_inner.0);
            known[slot] = if is_leaf { as_leaf } else { as_inner };
        }
        known.first().map_or(0.0, |cost| cost.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shuffle_keeps_every_number() {
        let mut shuffled: Vec<u32> = (0..1000).collect();
        shuffle(&mut shuffled);
        assert!(shuffled.windows(2).filter(|pair| pair[0] + 1 == pair[1]).count() < 10);
        shuffled.sort_unstable();
        assert!(shuffled.into_iter().eq(0..1000));
    }
}
