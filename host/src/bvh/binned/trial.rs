//! What a temporary tree over some items costs.

use super::{Binned, BinnedAxes, BinnedOptions, Bins, Part, measured};
use crate::bvh::ALONE;
use crate::bvh::bounds::Item;
use crate::bvh::heuristic::split_cost::{Area, First};
use crate::bvh::top_down::{Candidates, LeafRule};
use bytemuck::zeroed_vec;
use hedgerow::bvh::sah::Collapse;

/// How temporary trees are built.
const OPTIONS: BinnedOptions =
    BinnedOptions { bins: Bins::Fixed(16), axes: BinnedAxes::Longest, ..BinnedOptions::WALD };

/// Builds temporary trees, and keeps nothing of them but what they cost.
pub(in crate::bvh) struct Trial<'a> {
    binned: Binned<'a>,
}

impl<'a> Trial<'a> {
    /// With leaves where these costs make some.
    pub fn new(costs: &'a Collapse) -> Trial<'a> {
        Trial { binned: Binned { rule: LeafRule { costs, single: !costs.enabled }, options: &OPTIONS, flat: 0.0 } }
    }

    /// By how much a tree over these items costs more than each of them alone as a leaf; `None` if that is more than `limit`.
    ///
    /// No tree costs less than its items alone, and all splits of a node are over the same ones: what is compared is less by
    /// that, and reaches a limit sooner.
    pub fn excess(&self, mut items: Vec<Item>, limit: f32) -> Option<f32> {
        let mut spare: Vec<Item> = zeroed_vec(items.len());
        let mut order: Vec<u32> = zeroed_vec(items.len());
        let mut slots: Vec<u32> = zeroed_vec(items.len().saturating_sub(1));
        let node = measured(&items);
        let whole = Part { items: &mut items, spare: &mut spare, order: &mut order, slots: &mut slots, node };
        self.of_part(whole, 0, limit)
    }

    fn of_part(&self, mut part: Part<'_>, depth: u32, limit: f32) -> Option<f32> {
        let within = |excess: f32| (excess <= limit).then_some(excess);
        let count = part.items.len();
        if count == 1 {
            return within(0.0);
        }
        let (costs, area) = (self.binned.rule.costs, part.node.bounds.half_area());
        let Some(split) = self.binned.best(&Area, &(), &mut part, depth) else {
            let alone: f32 = part.items.iter().map(|item| costs.leaf_cost(item.bounds().half_area(), 1)).sum();
            return within((costs.leaf_cost(area, count as u32) - alone).max(0.0));
        };
        let step = within(costs.inner_cost(area, 0.0, 0.0))?;
        let [left, right] = self.binned.divide(part, split, First::Left);
        let rest = limit - step;
        let (of_left, of_right) = if count < ALONE {
            let of_left = self.of_part(left, depth + 1, rest)?;
            (of_left, self.of_part(right, depth + 1, rest - of_left)?)
        } else {
            let (of_left, of_right) =
                rayon::join(|| self.of_part(left, depth + 1, rest), || self.of_part(right, depth + 1, rest));
            (of_left?, of_right?)
        };
        within(step + (of_left + of_right))
    }
}

#[cfg(test)]
mod tests {
    use super::super::build;
    use super::*;
    use crate::bvh::bounds::around;
    use crate::bvh::bounds::tests::boxes;
    use crate::bvh::topology::{LEAF, Topology};

    /// What a finished tree costs, and the same of each of its items alone.
    fn costs_of(tree: &Topology, items: &[Item], costs: &Collapse) -> [f64; 2] {
        fn of(splits: &[u32], items: &[Item], costs: &Collapse) -> f64 {
            let area = around(items).half_area();
            match splits.split_first() {
                Some((&left, below)) if left != LEAF => {
                    let (left_splits, right_splits) = below.split_at(left as usize - 1);
                    let (left_items, right_items) = items.split_at(left as usize);
                    f64::from(costs.c_t * area)
                        + of(left_splits, left_items, costs)
                        + of(right_splits, right_items, costs)
                }
                _ => f64::from(costs.leaf_cost(area, items.len() as u32)),
            }
        }
        let in_order: Vec<Item> = tree.order.iter().map(|&i| items[i as usize]).collect();
        let alone = items.iter().map(|item| f64::from(costs.leaf_cost(item.bounds().half_area(), 1))).sum();
        [of(&tree.splits, &in_order, costs), alone]
    }

    #[test]
    fn a_trial_costs_what_the_tree_would() {
        for count in [1, 2, 20, 300, 2 * ALONE as u32] {
            for costs in [Collapse::SAH, Collapse::OFF] {
                let rule = LeafRule { costs: &costs, single: !costs.enabled };
                let tree = build(&Area, boxes(count), 1.0, rule, &OPTIONS);
                let [cost, alone] = costs_of(&tree, &boxes(count), &costs);
                let trial = Trial::new(&costs);
                let excess = trial.excess(boxes(count), f32::INFINITY).expect("no limit");
                assert!(
                    (f64::from(excess) - (cost - alone)).abs() <= 1e-4 * cost,
                    "{count}: {excess}, {cost} - {alone}"
                );
                assert_eq!(trial.excess(boxes(count), excess * 1.001), Some(excess), "{count} boxes");
                assert!(excess == 0.0 || trial.excess(boxes(count), excess * 0.99).is_none(), "{count} boxes");
            }
        }
    }
}
