//! The cheapest of all trees by sorted planes: each set's best split, found once.
//!
//! A set that splits can reach is what lies between two places of each of the three orders, so that there are O(n⁶) of n entries.
//! Splits that cost too much by a lower bound are not looked into, which leaves the optimum as it is. The bound is what it saves to
//! take an entry out of a tree whose other splits stay where they are:
//!
//! - Where it stands alone its cost, and its parent, whose box is no smaller than that around the entry and any other one. In a leaf
//!   with others its tests, and the leaf's box is as large. The less of both is what the entry *adds*, wherever it is.
//! - So a set costs no less than a part of it, and what the others add. Of all splits between two places of an order, none has sides
//!   that cost less than the left side of the first one, the right side of the last one, and what is between them adds.
//! - And a set that is no leaf costs its own step, and what all its entries add, but for one on either side, which only costs what
//!   it costs alone.

use super::{Entry, Found, MOST_BY_PLANES, leaf_cost, step_cost, whole};
use crate::bvh::bounds::Bounds;
use hedgerow::bvh::sah::Collapse;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Bounds are compared with that much room, so that no rounding cuts an optimum off.
const ROOM: f64 = 1.0 + 1e-9;

/// The best tree over at most 64 entries.
pub(super) fn search(entries: &[Entry], costs: &Collapse) -> Found {
    let mut planes = Planes::new(entries, costs);
    let all = whole(entries.len());
    let cost = if all == 0 { 0.0 } else { planes.cost(all) };
    let sets = planes.known.len();
    let mut left = HashMap::new();
    planes.keep(all, &mut left);
    Found { cost, sets, left }
}

/// A set, and sums over it.
#[derive(Clone, Copy)]
struct Side {
    set: u64,
    bounds: Bounds,
    weight: u64,
    /// What all entries add.
    adds: f64,
    /// By how much more the first and the second of them add than they cost alone.
    most: [f64; 2],
}

impl Side {
    const EMPTY: Side = Side { set: 0, bounds: Bounds::EMPTY, weight: 0, adds: 0.0, most: [0.0; 2] };
}

/// A split: what is on the left, a bound of what both sides cost, and what the entries on the left add.
#[derive(Clone, Copy)]
struct Split {
    left: u64,
    least: f64,
    adds: f64,
}

impl Split {
    const NONE: Split = Split { left: 0, least: 0.0, adds: 0.0 };
}

/// All splits of a set along an axis: in each place that with as many entries on the left.
type Splits = [Split; MOST_BY_PLANES];

/// By which splits of equal cost are told apart, as a sweep does: the distance from the middle, the axis, and the place.
type Rank = (usize, usize, usize);

/// One multiplication: the words are well spread already but for their ends.
#[derive(Default)]
struct Mixed(u64);

impl Hasher for Mixed {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(byte.into()));
    }

    fn write_u64(&mut self, word: u64) {
        let product = u128::from(self.0 ^ word) * 0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835;
        self.0 = (product >> 64) as u64 ^ product as u64;
    }
}

struct Planes<'a> {
    entries: &'a [Entry],
    costs: &'a Collapse,
    /// Along each axis the entries by centroid, equal ones by number.
    orders: [Vec<u8>; 3],
    /// What each entry adds.
    adds: Vec<f64>,
    /// What the sets cost that were split.
    known: HashMap<u64, f64, BuildHasherDefault<Mixed>>,
}

impl Planes<'_> {
    fn new<'a>(entries: &'a [Entry], costs: &'a Collapse) -> Planes<'a> {
        let orders = [0, 1, 2].map(|axis| {
            let mut order: Vec<u8> = (0..entries.len() as u8).collect();
            let centroid = |i: u8| {
                let Bounds { lo, hi } = entries[i as usize].bounds;
                lo[axis] + hi[axis] + 0.0
            };
            order.sort_by(|&a, &b| centroid(a).total_cmp(&centroid(b)));
            order
        });
        let adds = (0..entries.len()).map(|i| added_by(entries, i, costs)).collect();
        Planes { entries, costs, orders, adds, known: HashMap::default() }
    }

    #[inline]
    fn with(&self, side: Side, number: u8) -> Side {
        let (Entry { bounds, weight, cost }, adds) = (self.entries[number as usize], self.adds[number as usize]);
        let (more, [first, second]) = (adds - cost, side.most);
        Side {
            set: side.set | 1 << number,
            bounds: side.bounds.union(bounds),
            weight: side.weight + u64::from(weight),
            adds: side.adds + adds,
            most: [first.max(more), second.max(first.min(more))],
        }
    }

    fn leaf(&self, side: &Side) -> f64 {
        if self.costs.enabled { leaf_cost(self.costs, &side.bounds, side.weight) } else { f64::INFINITY }
    }

    /// What a set costs at least.
    #[inline]
    fn least(&self, side: &Side) -> f64 {
        let [first, second] = side.most;
        if side.set.is_power_of_two() {
            return side.adds - first;
        }
        self.leaf(side).min(step_cost(self.costs, &side.bounds) + (side.adds - first - second))
    }

    /// What the cheapest tree over a set costs.
    fn cost(&mut self, set: u64) -> f64 {
        if set.is_power_of_two() {
            return self.entries[set.trailing_zeros() as usize].cost;
        }
        if let Some(&cost) = self.known.get(&set) {
            return cost;
        }
        let (cost, _) = self.best_split(set);
        self.known.insert(set, cost);
        cost
    }

    /// The least cost of a set of several entries, and what is on the left then; 0 if the set is a leaf.
    fn best_split(&mut self, set: u64) -> (f64, u64) {
        // Not on the stack: there are as many levels as entries.
        let mut splits = vec![[Split::NONE; MOST_BY_PLANES]; 3];
        let side = self.splits(set, &mut splits);
        let (step, count) = (step_cost(self.costs, &side.bounds), set.count_ones() as usize);
        let mut best = Best { set, step, cost: self.leaf(&side), rank: (usize::MAX, 0, 0), left: 0 };
        // A good one at first, so that few of the others are looked into.
        let places = (0..3).flat_map(|axis| (1..count).map(move |at| (axis, at)));
        let least = |&(axis, at): &(usize, usize)| splits[axis][at].least;
        if let Some((axis, at)) = places.min_by(|a, b| least(a).total_cmp(&least(b))) {
            self.look_at(&splits[axis][at], axis, at, &mut best);
        }
        for (axis, splits) in splits.iter().enumerate() {
            let [first, last] = [&splits[1], &splits[count - 1]];
            let ends = [self.cost(first.left) - first.adds, self.cost(set & !last.left) + last.adds];
            self.look_between(&splits[..count], axis, [1, count - 1], ends, &mut best);
        }
        (best.cost, best.left)
    }

    /// What the sides of a split cost, if it may be the best.
    fn look_at(&mut self, split: &Split, axis: usize, at: usize, best: &mut Best) -> Option<[f64; 2]> {
        if best.step + split.least > best.cost * ROOM {
            return None;
        }
        let right = best.set & !split.left;
        let sides = [self.cost(split.left), self.cost(right)];
        let cost = best.step + (sides[0] + sides[1]);
        let rank = ((2 * at).abs_diff(best.set.count_ones() as usize), axis, at);
        if (cost, rank) < (best.cost, best.rank) {
            (best.cost, best.rank, best.left) = (cost, rank, split.left);
        }
        Some(sides)
    }

    /// Looks at the splits of an axis from a first to a last one. `ends` are what the left side of the first or of one before it costs,
    /// less what it adds; and what the right side of the last or of one behind it costs, and what all before it adds.
    fn look_between(&mut self, splits: &[Split], axis: usize, places: [usize; 2], ends: [f64; 2], best: &mut Best) {
        let [first, last] = places;
        if first > last || best.step + (ends[0] + ends[1]) > best.cost * ROOM {
            return;
        }
        let middle = first.midpoint(last);
        let sides = self.look_at(&splits[middle], axis, middle, best);
        let adds = splits[middle].adds;
        let [left_end, right_end] = sides.map_or(ends, |[left, right]| [left - adds, right + adds]);
        self.look_between(splits, axis, [first, middle - 1], [ends[0], right_end], best);
        self.look_between(splits, axis, [middle + 1, last], [left_end, ends[1]], best);
    }

    /// All splits of a set, and the set itself.
    fn splits(&self, set: u64, splits: &mut [Splits]) -> Side {
        let count = set.count_ones() as usize;
        let mut side = Side::EMPTY;
        for (order, splits) in self.orders.iter().zip(splits) {
            let mut here = [0; MOST_BY_PLANES];
            let in_set = order.iter().copied().filter(|&i| set >> i & 1 == 1);
            here.iter_mut().zip(in_set).for_each(|(to, i)| *to = i);
            side = Side::EMPTY;
            for at in 1..count {
                side = self.with(side, here[at - 1]);
                splits[at] = Split { left: side.set, least: self.least(&side), adds: side.adds };
            }
            side = Side::EMPTY;
            for at in (1..count).rev() {
                side = self.with(side, here[at]);
                splits[at].least += self.least(&side);
            }
            side = self.with(side, here[0]);
        }
        side
    }

    /// How the sets of the best tree over `set` are divided.
    fn keep(&mut self, set: u64, left: &mut HashMap<u64, u64>) {
        if set.count_ones() < 2 {
            return;
        }
        let (_, left_set) = self.best_split(set);
        left.insert(set, left_set);
        if left_set != 0 {
            self.keep(left_set, left);
            self.keep(set & !left_set, left);
        }
    }
}

/// The best split of a set so far.
struct Best {
    set: u64,
    step: f64,
    cost: f64,
    rank: Rank,
    left: u64,
}

/// What an entry adds to any tree that has others.
fn added_by(entries: &[Entry], number: usize, costs: &Collapse) -> f64 {
    let entry = &entries[number];
    let others = entries.iter().enumerate().filter(|&(other, _)| other != number);
    let around = others.map(|(_, other)| other.bounds.union(entry.bounds));
    let smallest = around.min_by(|a, b| a.half_area().total_cmp(&b.half_area())).unwrap_or(entry.bounds);
    let alone = entry.cost + step_cost(costs, &smallest);
    if costs.enabled { alone.min(leaf_cost(costs, &smallest, entry.weight.into())) } else { alone }
}
