//! Binned SAH: top-down, at each node the best of the planes between a few bins of the centroids.
//!
//! Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies"; Frantál 2019, section 3.1. Items are moved, not
//! indices, so that every pass over a node reads memory in order: from one array to the other, and back at the next level. Large
//! nodes are binned and divided by all threads, a piece each; small ones are built side by side. Pieces do not depend on the number
//! of threads, bins are minima, maxima and counts, and items keep their order on both sides: the tree is the same for any number of
//! threads.

mod bins;
mod ranked;
pub(super) mod trial;

use super::bounds::Item;
use super::heuristic::split_cost::{AxisSplits, First, Place, Side, SplitCost, growing};
use super::top_down::{self, Candidates, HALVED_FROM, LeafRule, divided_slots};
use super::topology::Topology;
pub(super) use bins::partition;
use bins::{FEW, Grid, Unsplit, centroids, fill, in_order_of_bins, measured, measured_alone, place_of, side, side_of};
use bytemuck::zeroed_vec;
use hedgerow::{Error, Result};
pub(super) use ranked::build_ahead;

/// How nodes are binned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BinnedOptions {
    /// How many bins there are along an axis.
    pub bins: Bins,
    /// Nodes of at most this many primitives are leaves, whatever they cost; 1 to 255.
    pub leaf: u32,
    /// Which axes are binned.
    pub axes: BinnedAxes,
    /// Whether a node without extent along any axis is a leaf, as in Frantál 2019: a floor then is one leaf, however many
    /// triangles it has. Only to show what that does.
    pub flat_leaves: bool,
}

/// How many bins a node has along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bins {
    /// This many, 2 to [`Bins::MOST`].
    Fixed(u32),
    /// 4 + 2 ⌊√n⌋ for n primitives (Frantál 2019, equation 8), at most [`Bins::MOST`].
    Adaptive,
}

impl Bins {
    /// The most there may be.
    pub const MOST: u32 = 256;

    fn of(self, count: usize) -> usize {
        let bins = match self {
            Bins::Fixed(bins) => bins as usize,
            Bins::Adaptive => 4 + 2 * count.isqrt(),
        };
        bins.clamp(2, Bins::MOST as usize)
    }
}

/// Which axes are binned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BinnedAxes {
    /// The one along which centroids extend farthest: fast.
    Longest,
    /// All three.
    All,
}

impl BinnedOptions {
    /// What Wald takes: 16 bins of the longest axis. Leaves are made by their cost alone.
    pub const WALD: BinnedOptions =
        BinnedOptions { bins: Bins::Fixed(16), leaf: 1, axes: BinnedAxes::Longest, flat_leaves: false };
}

impl BinnedOptions {
    pub(super) fn check(&self) -> Result<()> {
        match (self.bins, self.leaf) {
            (Bins::Fixed(bins), _) if !(2..=Bins::MOST).contains(&bins) => {
                Err(Error::Argument(format!("{bins} bins cannot be used; take 2 to {} bins", Bins::MOST)))
            }
            (_, leaf) if !(1..=255).contains(&leaf) => {
                Err(Error::Argument(format!("leaves of {leaf} primitives cannot be used; take 1 to 255 primitives")))
            }
            _ => Ok(()),
        }
    }
}

/// An extent of centroids that Frantál 2019 takes for none.
const FLAT: f32 = 1e-7;

/// The tree over `items`. `scale` is what their lengths were scaled by.
pub(super) fn build(
    by: &impl SplitCost,
    items: Vec<Item>,
    scale: f32,
    rule: LeafRule<'_>,
    options: &BinnedOptions,
) -> Topology {
    let binned = Binned::new(scale, rule, options);
    tree_over(items, |whole| top_down::build(&binned, by, whole))
}

/// The tree over `items` by what splits a part of them.
fn tree_over(mut items: Vec<Item>, build: impl FnOnce(Part<'_>)) -> Topology {
    let mut tree = Topology::new(items.len());
    let mut spare: Vec<Item> = zeroed_vec(items.len());
    let node = measured(&items);
    let Topology { order, splits } = &mut tree;
    build(Part { items: &mut items, spare: &mut spare, order, slots: splits, node });
    tree
}

/// The items of a node, room for as many, and where their primitives and the node's subtree are written.
struct Part<'a> {
    items: &'a mut [Item],
    spare: &'a mut [Item],
    order: &'a mut [u32],
    slots: &'a mut [u32],
    node: Unsplit,
}

impl<'a> Part<'a> {
    /// Its first items, and the others.
    fn split_at(self, left_count: usize, [left, right]: [Unsplit; 2]) -> [Part<'a>; 2] {
        let (left_items, items) = self.items.split_at_mut(left_count);
        let (left_spare, spare) = self.spare.split_at_mut(left_count);
        let (left_order, order) = self.order.split_at_mut(left_count);
        let [left_slots, slots] = divided_slots(self.slots, left_count);
        [
            Part { items: left_items, spare: left_spare, order: left_order, slots: left_slots, node: left },
            Part { items, spare, order, slots, node: right },
        ]
    }
}

/// A plane: its cost, and how many bins are on its left.
type Plane = (f32, usize);

/// The split of a node.
enum Split {
    /// In the middle of the order.
    Halved,
    /// At the beginning of a bin of a grid; what lies on either side.
    AtBin { grid: Grid, bin: usize, sides: [Side; 2] },
    /// Of a few items in this order, after so many.
    OfFew { order: [u32; FEW], left_count: usize },
}

/// What nodes are split by.
struct Binned<'a> {
    rule: LeafRule<'a>,
    options: &'a BinnedOptions,
    /// Extents of centroids up to this make a leaf.
    flat: f32,
}

impl<'a> Binned<'a> {
    fn new(scale: f32, rule: LeafRule<'a>, options: &'a BinnedOptions) -> Binned<'a> {
        Binned { rule, options, flat: if options.flat_leaves { 2.0 * FLAT * scale } else { 0.0 } }
    }

    /// The bins of a part along the axes that are looked at; none where centroids do not tell its items apart, or it is too deep.
    #[inline(always)]
    fn grids(&self, part: &Part<'_>, depth: u32) -> [Option<Grid>; 3] {
        let Part { items, node, .. } = part;
        let bins = self.options.bins.of(items.len());
        let grid = |axis| Grid::new(&node.centroids, axis, bins);
        match self.options.axes {
            _ if depth >= HALVED_FROM => [None; 3],
            BinnedAxes::Longest => [grid(node.centroids.longest_edge().0), None, None],
            BinnedAxes::All => [0, 1, 2].map(grid),
        }
    }

    /// Whether a part is a leaf, whatever that costs.
    #[inline(always)]
    fn is_told_a_leaf(&self, Part { items, node, .. }: &Part<'_>) -> bool {
        let edges = (node.centroids.hi - node.centroids.lo).min_element();
        !self.rule.single && (items.len() <= self.options.leaf as usize || edges < self.flat)
    }

    #[inline(always)]
    fn search<'s, C: SplitCost>(&'s self, by: &'s C, here: &'s C::Here, part: &'s Part<'_>) -> Search<'s, C> {
        Search { by, here, rule: self.rule, items: part.items, weight: by.of_node(here, &part.node.bounds) }
    }
}

impl Candidates for Binned<'_> {
    type Part<'a> = Part<'a>;
    type Split = Split;

    #[inline(always)]
    fn count(&self, part: &Part<'_>) -> usize {
        part.items.len()
    }

    #[inline(always)]
    fn best<C: SplitCost>(&self, by: &C, here: &C::Here, part: &mut Part<'_>, depth: u32) -> Option<Split> {
        if self.is_told_a_leaf(part) {
            return None;
        }
        let grids = self.grids(part, depth);
        let search = self.search(by, here, part);
        let Some(bins) = grids.iter().flatten().map(|grid| grid.bins).next() else { return search.halved() };
        if part.items.len() <= FEW && !C::BY_BOTH {
            search.of_few(&grids)
        } else if bins <= 16 {
            search.at_bin::<16>(&grids)
        } else {
            search.at_bin::<{ Bins::MOST as usize }>(&grids)
        }
    }

    fn sides(&self, by: &impl SplitCost, part: &Part<'_>, split: Option<&Split>) -> [Side; 2] {
        let items = &*part.items;
        match split {
            None => [side(by, items), Side::EMPTY],
            Some(Split::Halved) => halves(items).map(|half| side(by, half)),
            Some(Split::AtBin { sides, .. }) => *sides,
            Some(Split::OfFew { order, left_count }) => {
                let (left, right) = order[..items.len()].split_at(*left_count);
                let of = |key: &u32| side_of(by, &items[place_of(*key)]);
                [left, right].map(|keys| keys.iter().map(of).fold(Side::EMPTY, Side::union))
            }
        }
    }

    fn members(&self, part: &Part<'_>, split: &Split, each: &mut dyn FnMut(usize, u32)) {
        let items = &*part.items;
        let all = |side: usize, items: &[Item], each: &mut dyn FnMut(usize, u32)| {
            items.iter().for_each(|item| each(side, item.primitive()));
        };
        match split {
            Split::Halved => halves(items).iter().zip(0..).for_each(|(half, side)| all(side, half, each)),
            Split::AtBin { grid, bin, .. } => {
                items.iter().for_each(|item| each(usize::from(grid.bin_of(item) >= *bin), item.primitive()));
            }
            Split::OfFew { order, left_count } => {
                for (at, key) in order[..items.len()].iter().enumerate() {
                    each(usize::from(at >= *left_count), items[place_of(*key)].primitive());
                }
            }
        }
    }

    #[inline(always)]
    fn divide<'a>(&self, part: Self::Part<'a>, split: Split, first: First) -> [Self::Part<'a>; 2] {
        let Part { items, spare, order, slots, node } = part;
        let count = items.len();
        let (left_count, sides) = match split {
            Split::Halved => {
                let sides = halves(items).map(measured);
                spare.copy_from_slice(items);
                (count / 2, sides)
            }
            Split::AtBin { grid, bin, sides } => {
                let left_count = sides[0].count as usize;
                // That is, `grid.bin_of(item) < bin`.
                partition(items, spare, left_count, |item| grid.place(item) < bin as f32);
                let (left, right) = spare.split_at(left_count);
                let of = |side: Side, items: &[Item]| Unsplit { bounds: side.bounds, centroids: centroids(items) };
                (left_count, [of(sides[0], left), of(sides[1], right)])
            }
            Split::OfFew { order, left_count } => {
                for (item, key) in spare.iter_mut().zip(order) {
                    *item = items[place_of(key)];
                }
                let (left, right) = spare.split_at(left_count);
                (left_count, [measured_alone(left), measured_alone(right)])
            }
        };
        // The items are in the other array now.
        let (items, spare) = (spare, items);
        if first == First::Right {
            items.rotate_left(left_count);
        }
        let [left_count, _] = first.in_order([left_count, count - left_count]);
        Part { items, spare, order, slots, node }.split_at(left_count, first.in_order(sides))
    }

    fn end(&self, part: Part<'_>) {
        part.order.iter_mut().zip(part.items).for_each(|(primitive, item)| *primitive = item.primitive());
    }
}

/// The search for the split of a node.
struct Search<'a, C: SplitCost> {
    by: &'a C,
    here: &'a C::Here,
    rule: LeafRule<'a>,
    items: &'a [Item],
    /// Of the node itself.
    weight: f32,
}

impl<C: SplitCost> Search<'_, C> {
    #[inline(always)]
    fn is_leaf(&self, cost: f32) -> bool {
        self.rule.is_leaf(self.weight, self.items.len() as u32, cost)
    }

    /// The cost of each side together with all before it.
    #[inline(always)]
    fn costs(&self, sides: impl Iterator<Item = Side>) -> impl Iterator<Item = f32> {
        let costs = self.rule.costs;
        self.by.of_sides(self.here, growing(sides)).map(|(weight, side)| costs.leaf_cost(weight, side.count))
    }

    /// Splits in the middle of the order, as centroids do not tell items apart.
    fn halved(&self) -> Option<Split> {
        let sides = halves(self.items).map(|half| side(self.by, half));
        let cost: f32 = sides.into_iter().flat_map(|side| self.costs(std::iter::once(side))).sum();
        (!self.is_leaf(cost)).then_some(Split::Halved)
    }

    /// By the plane between at most `N` bins of an axis that costs least; of equal ones the first, along the first axis. Not inlined:
    /// its bins would lie on the stack once for each level, and small nodes would pay for the room of 256.
    #[inline(never)]
    fn at_bin<const N: usize>(&self, grids: &[Option<Grid>; 3]) -> Option<Split> {
        let mut present = [(*grids).into_iter().flatten().next()?; 3];
        let count = present.iter_mut().zip(grids.iter().flatten()).map(|(place, grid)| *place = *grid).count();
        let mut bins = [[Side::EMPTY; N]; 3];
        let (grids, bins) = (&present[..count], &mut bins[..count]);
        fill(self.by, self.items, grids, bins);
        let planes = grids.iter().zip(&*bins).map(|(grid, bins)| self.best_plane::<N>(&bins[..grid.bins], grid));
        let cheaper = |a: (usize, Plane), b: (usize, Plane)| if b.1.0 < a.1.0 { b } else { a };
        let (axis, (cost, bin)) = planes.enumerate().reduce(cheaper)?;
        if self.is_leaf(cost) {
            return None;
        }
        let (grid, bins) = (grids[axis], &bins[axis]);
        let around = |bins: &[Side]| bins.iter().copied().fold(Side::EMPTY, Side::union);
        Some(Split::AtBin { grid, bin, sides: [around(&bins[..bin]), around(&bins[bin..grid.bins])] })
    }

    /// The best plane between bins, of which the first and the last hold something.
    fn best_plane<const N: usize>(&self, bins: &[Side], grid: &Grid) -> Plane {
        if C::BY_BOTH {
            return self.best_plane_by_both(bins, grid);
        }
        let first = (f32::INFINITY, 1);
        self.planes::<N>(bins).fold(first, |best, plane| if plane.0 < best.0 { plane } else { best })
    }

    /// All planes between bins.
    #[inline(always)]
    fn planes<const N: usize>(&self, bins: &[Side]) -> impl Iterator<Item = Plane> {
        let mut right_costs = [0.0; N];
        let from_right = self.costs(bins[1..].iter().rev().copied());
        right_costs[1..bins.len()].iter_mut().rev().zip(from_right).for_each(|(place, cost)| *place = cost);
        let from_left = self.costs(bins[..bins.len() - 1].iter().copied());
        from_left.zip(1..).map(move |(left_cost, at)| (left_cost + right_costs[at], at))
    }

    /// The same by a heuristic whose sides cost something together alone.
    fn best_plane_by_both(&self, bins: &[Side], grid: &Grid) -> Plane {
        let lefts: Vec<Side> = growing(bins[..bins.len() - 1].iter().copied()).collect();
        let mut rights: Vec<Side> = growing(bins[1..].iter().rev().copied()).collect();
        rights.reverse();
        let place = |item: &Item| {
            let bin = grid.bin_of(item);
            Place { primitive: item.primitive(), first: bin, last: bin }
        };
        let splits = AxisSplits { lefts: &lefts, rights: &rights };
        let costs = self.by.of_splits(self.here, &splits, self.items.iter().map(place), self.rule.costs);
        costs.into_iter().zip(1..).fold((f32::INFINITY, 1), |best, plane| if plane.0 < best.0 { plane } else { best })
    }

    /// The same for a few items, in the order of their bins: most bins are empty then.
    #[inline(always)]
    fn of_few(&self, grids: &[Option<Grid>; 3]) -> Option<Split> {
        if C::GROWS && !self.rule.single {
            // Whatever the leaves below will be, each item is in one that is no smaller than itself.
            let least = self.items.iter().map(|item| {
                let weight = self.by.of_node(self.here, &item.bounds());
                self.rule.costs.leaf_cost(weight, 1)
            });
            if self.is_leaf(least.sum()) {
                return None;
            }
        }
        let mut best = (f32::INFINITY, 0, [0; FEW]);
        for grid in grids.iter().flatten() {
            let order = in_order_of_bins(self.items, grid);
            let (cost, left_count) = self.best_plane_of_few(&order);
            if cost < best.0 || best.1 == 0 {
                best = (cost, left_count, order);
            }
        }
        let (cost, left_count, order) = best;
        (!self.is_leaf(cost)).then_some(Split::OfFew { order, left_count })
    }

    /// The cost of the best plane, and how many items are on its left, of items in the order of their bins.
    #[inline(always)]
    fn best_plane_of_few(&self, order: &[u32; FEW]) -> Plane {
        let order = &order[..self.items.len()];
        let side = |key: &u32| side_of(self.by, &self.items[place_of(*key)]);
        let mut right_costs = [0.0; FEW];
        let from_right = self.costs(order[1..].iter().rev().map(side));
        right_costs[1..order.len()].iter_mut().rev().zip(from_right).for_each(|(place, cost)| *place = cost);
        let from_left = self.costs(order[..order.len() - 1].iter().map(side));
        let mut best = (f32::INFINITY, 0);
        for ((left_cost, right_cost), at) in from_left.zip(&right_costs[1..]).zip(1..) {
            if order[at - 1] >> 8 != order[at] >> 8 {
                let cost = left_cost + right_cost;
                if cost < best.0 || best.1 == 0 {
                    best = (cost, at);
                }
            }
        }
        best
    }
}

/// Both halves of the order.
fn halves(items: &[Item]) -> [&[Item]; 2] {
    let (left, right) = items.split_at(items.len() / 2);
    [left, right]
}

#[cfg(test)]
mod tests {
    use super::super::bounds::{Bounds, around, tests::boxes};
    use super::super::heuristic::split_cost::Area;
    use super::super::topology::LEAF;
    use super::*;
    use hedgerow::bvh::sah::Collapse;

    /// The items on either side of a plane.
    type Sides = [Vec<Item>; 2];

    /// The same, plainly: every plane is tried, with boxes made anew.
    fn plain(items: &[Item], rule: LeafRule<'_>, options: &BinnedOptions, tree: &mut Topology) {
        let centroids = items.iter().fold(Bounds::EMPTY, |all, item| all.union(Bounds::point(item.centroid())));
        let cost = |items: &[Item]| rule.costs.leaf_cost(around(items).half_area(), items.len() as u32);
        let axes = if options.axes == BinnedAxes::All { vec![0, 1, 2] } else { vec![centroids.longest_edge().0] };
        let bins = options.bins.of(items.len());
        let grids: Vec<Grid> = axes.into_iter().filter_map(|axis| Grid::new(&centroids, axis, bins)).collect();
        let mut best: Option<(f32, Sides)> = None;
        let mut consider = |sides: Sides| {
            let cost = cost(&sides[0]) + cost(&sides[1]);
            let is_split = sides.iter().all(|side| !side.is_empty());
            if is_split && best.as_ref().is_none_or(|best| cost < best.0) {
                best = Some((cost, sides));
            }
        };
        for grid in &grids {
            let mut items = items.to_vec();
            if items.len() <= FEW {
                items.sort_by_key(|item| grid.bin_of(item));
            }
            (1..bins).for_each(|bin| {
                consider(
                    [true, false].map(|is_left| {
                        items.iter().copied().filter(|item| (grid.bin_of(item) < bin) == is_left).collect()
                    }),
                )
            });
        }
        if grids.is_empty() {
            consider(halves(items).map(<[Item]>::to_vec));
        }
        let is_leaf = |cost| rule.is_leaf(around(items).half_area(), items.len() as u32, cost);
        let is_small = !rule.single && items.len() <= options.leaf as usize;
        let Some((_, [left, right])) = best.filter(|best| !is_small && !is_leaf(best.0)) else {
            tree.splits.extend(items.iter().skip(1).map(|_| LEAF));
            return tree.order.extend(items.iter().map(Item::primitive));
        };
        tree.splits.push(left.len() as u32);
        plain(&left, rule, options, tree);
        plain(&right, rule, options, tree);
    }

    #[test]
    fn bins_give_the_best_plane_of_all_at_every_node() {
        let wald = BinnedOptions::WALD;
        let all = BinnedOptions { bins: Bins::Adaptive, axes: BinnedAxes::All, ..wald };
        for options in [wald, all, BinnedOptions { bins: Bins::Fixed(2), leaf: 3, ..all }] {
            for count in [1, 2, 3, 16, 17, 150, 700] {
                for single in [false, true] {
                    let rule = LeafRule { costs: &Collapse::SAH, single };
                    let mut expected = Topology { order: Vec::new(), splits: Vec::new() };
                    plain(&boxes(count), rule, &options, &mut expected);
                    let found = build(&Area, boxes(count), 1.0, rule, &options);
                    assert!(found == expected, "{count} boxes, {options:?}, {single}");
                }
            }
        }
    }
}
