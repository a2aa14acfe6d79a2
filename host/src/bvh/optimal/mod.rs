//! The cheapest trees there are over a few boxes: what greedy builders are compared with.
//!
//! van Kralingen 2023, "Alternatives to the Surface Area Heuristic", section 3.4 and chapter 4, enumerates all trees whose nodes are
//! split by planes between sorted centroids. The cost of a subtree depends on its set of boxes alone. So each set is looked at
//! once here, in place of each tree, and leaves of any size cost nothing more to find: [`of_planes`]. [`of_bipartitions`] finds the
//! cheapest of all trees, by planes or not. No tree of any builder costs less.
//!
//! `top` uses the former over the largest subtrees of a finished tree.

mod bipartitions;
mod planes;
pub(super) mod top;

use super::bounds::{Bounds, Item};
use super::input::Input;
use super::topology::Topology;
use super::{box_record, finish};
use hedgerow::bvh::layout::{BoxRecord, Bvh2};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::geometry::finite_box;
use hedgerow::geometry::Aabb;
use hedgerow::{Error, Result};
use std::collections::HashMap;

/// The most boxes that [`of_planes`] takes: a set of them is a word.
pub const MOST_BY_PLANES: usize = 64;
/// The most boxes that [`of_bipartitions`] takes: it looks at 3ⁿ pairs of sets.
pub const MOST_BY_BIPARTITIONS: usize = 16;

/// A tree of the least cost.
#[derive(Debug, Clone)]
pub struct Optimum {
    /// The tree. Its cost is in the header.
    pub tree: Bvh2<BoxRecord>,
    /// How many sets of boxes the search has split.
    pub sets: usize,
}

/// The cheapest of all trees over `boxes` whose nodes are split between two centroids along an axis. Leaves have any size, or one
/// box where `costs` are not enabled. Boxes that are not finite or are inside out are left out.
///
/// The time grows with the number of sets, which is O(n⁶) for n boxes.
///
/// # Errors
/// There are more than [`MOST_BY_PLANES`] boxes.
pub fn of_planes(boxes: &[Aabb], costs: &Collapse) -> Result<Optimum> {
    of(boxes, costs, MOST_BY_PLANES, |entries| planes::search(entries, costs))
}

/// The cheapest of all trees over `boxes`, whichever way they are divided. Otherwise as [`of_planes`].
///
/// # Errors
/// There are more than [`MOST_BY_BIPARTITIONS`] boxes.
pub fn of_bipartitions(boxes: &[Aabb], costs: &Collapse) -> Result<Optimum> {
    of(boxes, costs, MOST_BY_BIPARTITIONS, |entries| bipartitions::search(entries, costs))
}

fn of(boxes: &[Aabb], costs: &Collapse, most: usize, search: impl Fn(&[Entry]) -> Found) -> Result<Optimum> {
    if boxes.len() > most {
        return Err(Error::Argument(format!(
            "the optimum over {} boxes is out of reach; take {most} at most",
            boxes.len()
        )));
    }
    let finite = |i: u32| finite_box(&boxes[i as usize]).map(|bounds| Bounds::of(&bounds));
    let input = Input::new(boxes.len(), finite);
    // Costs are compared in the lengths that the header's is in.
    let in_scale = |item: &Item| item.scaled(input.scale / input.item_scale);
    let entries: Vec<Entry> = input.items.iter().map(|item| Entry::of_box(&in_scale(item), costs)).collect();
    let found = search(&entries);
    let mut tree = found.topology(entries.len(), |_| None);
    tree.order.iter_mut().for_each(|i| *i = input.items[*i as usize].primitive());
    let records = finish::records(&tree.order, |i| box_record(boxes, i));
    let collapsed = finish::collapse(&mut tree, &records, costs, input.scale);
    Ok(Optimum { tree: finish::layout(&input, &tree, &collapsed, records), sets: found.sets })
}

/// What a tree is searched over: a box, or a subtree that stays as it is.
#[derive(Debug, Clone, Copy)]
struct Entry {
    bounds: Bounds,
    /// How many primitives it counts for in a leaf.
    weight: u32,
    /// What it costs where it stands alone.
    cost: f64,
}

impl Entry {
    fn of_box(item: &Item, costs: &Collapse) -> Entry {
        let (bounds, weight) = (item.bounds(), item.weight());
        Entry { bounds, weight, cost: leaf_cost(costs, &bounds, weight.into()) }
    }
}

/// [`Collapse::leaf_cost`] in double precision: sums of other orders are not to differ.
fn leaf_cost(costs: &Collapse, bounds: &Bounds, weight: u64) -> f64 {
    f64::from(costs.c_i) * f64::from(bounds.half_area()) * weight as f64
}

/// The cost of an inner node alone.
fn step_cost(costs: &Collapse, bounds: &Bounds) -> f64 {
    f64::from(costs.c_t) * f64::from(bounds.half_area())
}

/// How each set of a tree is divided: one bit an entry.
struct Found {
    /// The cost of the whole.
    cost: f64,
    sets: usize,
    /// Of each set of several entries in the tree, what is on the left; 0 if it is a leaf.
    left: HashMap<u64, u64>,
}

impl Found {
    /// The tree over the numbers of entries. `instead` says how a leaf is divided all the same.
    fn topology(&self, count: usize, instead: impl Fn(u64) -> Option<u64>) -> Topology {
        let mut tree = Topology::new(count);
        let (mut slot, mut place) = (0, 0);
        let mut next: Vec<u64> = Some(whole(count)).filter(|_| count > 0).into_iter().collect();
        while let Some(set) = next.pop() {
            let left = self.left.get(&set).copied().filter(|&left| left != 0).or_else(|| instead(set));
            match left.filter(|_| set.count_ones() > 1) {
                Some(left) => {
                    tree.splits[slot] = left.count_ones();
                    slot += 1;
                    next.extend([set & !left, left]);
                }
                None => {
                    slot += set.count_ones() as usize - 1;
                    for entry in entries_of(set) {
                        tree.order[place] = entry as u32;
                        place += 1;
                    }
                }
            }
        }
        tree
    }
}

/// The set of the first `count` entries.
fn whole(count: usize) -> u64 {
    if count == 0 { 0 } else { u64::MAX >> (64 - count) }
}

/// The entries of a set, in order.
fn entries_of(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let entry = set.trailing_zeros() as usize;
        set &= set.wrapping_sub(1);
        (entry < 64).then_some(entry)
    })
}

#[cfg(test)]
pub(super) mod tests;
