//! The cheapest of all trees: each set's best division into any two.

use super::{Entry, Found, leaf_cost, step_cost, whole};
use crate::bvh::bounds::Bounds;
use hedgerow::bvh::sah::Collapse;
use std::collections::HashMap;

/// The best tree over at most 16 entries. Smaller sets have smaller numbers, so that their costs are known.
pub(super) fn search(entries: &[Entry], costs: &Collapse) -> Found {
    let sets = whole(entries.len()) as usize + 1;
    let mut best = vec![Best { bounds: Bounds::EMPTY, weight: 0, cost: 0.0, left: 0 }; sets];
    for set in 1..sets {
        let entry = &entries[set.trailing_zeros() as usize];
        let others = &best[set & (set - 1)];
        let (bounds, weight) = (others.bounds.union(entry.bounds), others.weight + u64::from(entry.weight));
        let (cost, left) =
            if set.is_power_of_two() { (entry.cost, 0) } else { divided(&best, set, &bounds, weight, costs) };
        best[set] = Best { bounds, weight, cost, left };
    }
    let left: HashMap<u64, u64> = (0..).zip(&best).map(|(set, best)| (set, best.left as u64)).collect();
    Found { cost: best[sets - 1].cost, sets: sets - 1 - entries.len(), left }
}

/// The best subtree over a set.
#[derive(Clone)]
struct Best {
    bounds: Bounds,
    weight: u64,
    cost: f64,
    left: usize,
}

/// The least cost of a set, and what is on the left then; 0 if the set is a leaf.
fn divided(best: &[Best], set: usize, bounds: &Bounds, weight: u64, costs: &Collapse) -> (f64, usize) {
    let leaf = if costs.enabled { leaf_cost(costs, bounds, weight) } else { f64::INFINITY };
    let step = step_cost(costs, bounds);
    // The first entry is on the left: the other half of the divisions are mirrored.
    let first = set & set.wrapping_neg();
    let others = set & !first;
    let mut least = (f64::INFINITY, 0);
    let mut right = others;
    while right > 0 {
        let cost = step + (best[set & !right].cost + best[right].cost);
        if cost < least.0 {
            least = (cost, set & !right);
        }
        right = (right - 1) & others;
    }
    if leaf < least.0 { (leaf, 0) } else { least }
}
