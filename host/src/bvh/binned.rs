//! Binned SAH: top-down, at each node the best of the planes between a few bins of the centroids.
//!
//! Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies"; Frantál 2019, section 3.1. Items are moved, not
//! indices, so that every pass over a node reads memory in order: from one array to the other, and back at the next level. Large
//! nodes are binned and divided by all threads, a piece each; small ones are built side by side. Pieces do not depend on the number
//! of threads, bins are minima, maxima and counts, and items keep their order on both sides: the tree is the same for any number of
//! threads.

use super::bounds::{Bounds, Item, around};
use super::sweep::HALVED_FROM;
use super::topology::{LEAF, Topology};
use super::{ALONE, DIVIDED_ABOVE};
use bytemuck::zeroed_vec;
use hedgerow::bvh::sah::Collapse;
use hedgerow::{Error, Result};
use rayon::prelude::*;

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

/// From this many items on a node is binned and divided by all threads.
const TOGETHER: usize = 1 << 16;
/// What one of them takes at a time.
const PIECE: usize = 1 << 13;
/// A node of this many items at most has fewer of them than bins, or not many more.
const FEW: usize = 16;
/// Centroids whose extent is less than this part of the scene's are not told apart by an axis.
const LEAST_EXTENT: f32 = 1.0 / (1u64 << 60) as f32;
/// An extent of centroids that Frantál 2019 takes for none.
const FLAT: f32 = 1e-7;

/// The tree over `items`. `scale` is what their lengths were scaled by.
pub(super) fn build(
    mut items: Vec<Item>,
    scale: f32,
    costs: &Collapse,
    single: bool,
    options: &BinnedOptions,
) -> Topology {
    let mut tree = Topology::new(items.len());
    let mut spare: Vec<Item> = zeroed_vec(items.len());
    let flat = if options.flat_leaves { 2.0 * FLAT * scale } else { 0.0 };
    let build = Build { costs, single, options, flat };
    let node = build.measured(&items);
    let whole = Part { items: &mut items, spare: &mut spare, order: &mut tree.order, splits: &mut tree.splits };
    build.subtree(whole, node, 0);
    tree
}

/// What a subtree is built over, room for as many items, and where it is written.
struct Part<'a> {
    items: &'a mut [Item],
    spare: &'a mut [Item],
    order: &'a mut [u32],
    splits: &'a mut [u32],
}

impl Part<'_> {
    /// Writes its primitives: they are in a leaf.
    fn end(self) {
        self.order.iter_mut().zip(self.items).for_each(|(primitive, item)| *primitive = item.primitive());
    }
}

/// A node before it is split: the box around its items, and that around their centroids (twice them).
#[derive(Debug, Clone, Copy)]
struct Unsplit {
    bounds: Bounds,
    centroids: Bounds,
}

impl Unsplit {
    const EMPTY: Unsplit = Unsplit { bounds: Bounds::EMPTY, centroids: Bounds::EMPTY };

    #[inline(always)]
    fn add(&mut self, item: &Item) {
        let bounds = item.bounds();
        self.bounds = self.bounds.union(bounds);
        self.centroids = self.centroids.union(Bounds::point(bounds.lo + bounds.hi));
    }

    #[inline(always)]
    fn union(self, other: Unsplit) -> Unsplit {
        Unsplit { bounds: self.bounds.union(other.bounds), centroids: self.centroids.union(other.centroids) }
    }
}

/// What lies in a bin.
#[derive(Debug, Clone, Copy)]
struct Bin {
    items: Unsplit,
    count: u32,
}

impl Bin {
    const EMPTY: Bin = Bin { items: Unsplit::EMPTY, count: 0 };

    fn union(self, other: Bin) -> Bin {
        Bin { items: self.items.union(other.items), count: self.count + other.count }
    }
}

/// Equal bins along an axis.
#[derive(Debug, Clone, Copy)]
struct Grid {
    axis: usize,
    least: f32,
    per_length: f32,
    bins: usize,
}

impl Grid {
    /// Over what extends that far; `None` where centroids cannot be told apart.
    fn new(centroids: &Bounds, axis: usize, bins: usize) -> Option<Grid> {
        let (least, most) = (centroids.lo[axis], centroids.hi[axis]);
        let extent = most - least;
        (extent > LEAST_EXTENT).then(|| Grid { axis, least, per_length: bins as f32 / extent, bins })
    }

    /// How many bins it is from the first one's beginning.
    #[inline(always)]
    fn place(&self, item: &Item) -> f32 {
        (item.centroid_on(self.axis) - self.least) * self.per_length
    }

    #[inline(always)]
    fn bin_of(&self, item: &Item) -> usize {
        (self.place(item) as usize).min(self.bins - 1)
    }
}

/// A plane: its cost, and how many bins are on its left.
type Plane = (f32, usize);

/// A node that is split: how many items are on the left, and what lies on either side.
struct Divided {
    left_count: usize,
    /// Whether the items are in `spare` now.
    is_moved: bool,
    left: Unsplit,
    right: Unsplit,
}

struct Build<'a> {
    costs: &'a Collapse,
    single: bool,
    options: &'a BinnedOptions,
    /// Extents of centroids up to this make a leaf.
    flat: f32,
}

impl Build<'_> {
    fn measured(&self, items: &[Item]) -> Unsplit {
        let of = |items: &[Item]| {
            let mut all = Unsplit::EMPTY;
            items.iter().for_each(|item| all.add(item));
            all
        };
        items.par_chunks(PIECE).map(of).reduce(|| Unsplit::EMPTY, Unsplit::union)
    }

    fn subtree(&self, part: Part<'_>, node: Unsplit, depth: u32) {
        if part.splits.is_empty() {
            return part.end();
        }
        let count = part.items.len();
        let Some(Divided { left_count, is_moved, left, right }) = self.divide(part.items, part.spare, &node, depth)
        else {
            part.splits[0] = LEAF;
            return part.end();
        };
        part.splits[0] = left_count as u32;
        let (items, spare) = if is_moved { (part.spare, part.items) } else { (part.items, part.spare) };
        let (left_items, right_items) = items.split_at_mut(left_count);
        let (left_spare, right_spare) = spare.split_at_mut(left_count);
        let (left_order, right_order) = part.order.split_at_mut(left_count);
        let (left_splits, right_splits) = part.splits[1..].split_at_mut(left_count - 1);
        let on_left = Part { items: left_items, spare: left_spare, order: left_order, splits: left_splits };
        let on_right = Part { items: right_items, spare: right_spare, order: right_order, splits: right_splits };
        if count < ALONE || depth >= DIVIDED_ABOVE {
            self.subtree(on_left, left, depth + 1);
            self.subtree(on_right, right, depth + 1);
        } else {
            rayon::join(|| self.subtree(on_left, left, depth + 1), || self.subtree(on_right, right, depth + 1));
        }
    }

    /// Brings what is on the left before the others; `None` if the node is a leaf.
    fn divide(&self, items: &[Item], spare: &mut [Item], node: &Unsplit, depth: u32) -> Option<Divided> {
        let edges = (node.centroids.hi - node.centroids.lo).min_element();
        if !self.single && (items.len() <= self.options.leaf as usize || edges < self.flat) {
            return None;
        }
        let area = node.bounds.half_area();
        let bins = self.options.bins.of(items.len());
        let grid = |axis| Grid::new(&node.centroids, axis, bins);
        let grids = match self.options.axes {
            BinnedAxes::Longest => [grid(node.centroids.longest_edge().0), None, None],
            BinnedAxes::All => [0, 1, 2].map(grid),
        };
        if depth >= HALVED_FROM || grids.iter().all(Option::is_none) {
            return self.halved(items, area);
        }
        if items.len() <= FEW {
            return self.divide_few(items, spare, area, &grids);
        }
        if bins <= 16 {
            self.divide_by::<16>(items, spare, area, &grids)
        } else {
            self.divide_by::<{ Bins::MOST as usize }>(items, spare, area, &grids)
        }
    }

    fn is_leaf(&self, area: f32, count: usize, cost: f32) -> bool {
        !self.single && self.costs.leaf_cost(area, count as u32) < self.costs.inner_cost(area, cost, 0.0)
    }

    /// Splits in the middle of the order, as centroids do not tell items apart.
    fn halved(&self, items: &[Item], area: f32) -> Option<Divided> {
        let (left, right) = items.split_at(items.len() / 2);
        let cost = self.costs.leaf_cost(around(left).half_area(), left.len() as u32)
            + self.costs.leaf_cost(around(right).half_area(), right.len() as u32);
        let divided = || {
            let (left_count, is_moved) = (left.len(), false);
            Divided { left_count, is_moved, left: self.measured(left), right: self.measured(right) }
        };
        (!self.is_leaf(area, items.len(), cost)).then(divided)
    }

    /// By the plane between at most `N` bins of an axis that costs least; of equal ones the first, along the first axis. Not inlined:
    /// its bins would lie on the stack once for each level, and small nodes would pay for the room of 256.
    #[inline(never)]
    fn divide_by<const N: usize>(
        &self,
        items: &[Item],
        spare: &mut [Item],
        area: f32,
        grids: &[Option<Grid>; 3],
    ) -> Option<Divided> {
        let mut best: Option<(Plane, Grid)> = None;
        let (mut bins, mut of_best) = (&mut [Bin::EMPTY; N], &mut [Bin::EMPTY; N]);
        for grid in grids.iter().flatten() {
            fill(items, grid, bins);
            let plane = self.best_plane::<N>(&bins[..grid.bins]);
            if best.is_none_or(|best| plane.0 < best.0.0) {
                best = Some((plane, *grid));
                std::mem::swap(&mut bins, &mut of_best);
            }
        }
        let ((cost, bin), grid) = best?;
        if self.is_leaf(area, items.len(), cost) {
            return None;
        }
        let side = |bins: &[Bin]| bins.iter().fold(Bin::EMPTY, |all, bin| all.union(*bin));
        let (left, right) = (side(&of_best[..bin]), side(&of_best[bin..grid.bins]));
        let left_count = left.count as usize;
        // That is, `grid.bin_of(item) < bin`.
        partition(items, spare, left_count, |item| grid.place(item) < bin as f32);
        Some(Divided { left_count, is_moved: true, left: left.items, right: right.items })
    }

    /// The best plane between bins, of which the first and the last hold something.
    fn best_plane<const N: usize>(&self, bins: &[Bin]) -> Plane {
        let mut right_costs = [0.0; N];
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        for (bin, cost) in bins.iter().zip(&mut right_costs).skip(1).rev() {
            bounds = bounds.union(bin.items.bounds);
            count += bin.count;
            *cost = self.costs.leaf_cost(bounds.half_area(), count);
        }
        let (mut bounds, mut count) = (Bounds::EMPTY, 0);
        let mut best = (f32::INFINITY, 1);
        for (at, right_cost) in (1..bins.len()).zip(&right_costs[1..]) {
            bounds = bounds.union(bins[at - 1].items.bounds);
            count += bins[at - 1].count;
            let cost = self.costs.leaf_cost(bounds.half_area(), count) + right_cost;
            if cost < best.0 {
                best = (cost, at);
            }
        }
        best
    }

    /// The same for a few items, in the order of their bins: most bins are empty then.
    fn divide_few(&self, items: &[Item], spare: &mut [Item], area: f32, grids: &[Option<Grid>; 3]) -> Option<Divided> {
        let count = items.len();
        // Whatever the leaves below will be, each item is in one that is no smaller than itself.
        let least: f32 = items.iter().map(|item| self.costs.leaf_cost(item.bounds().half_area(), 1)).sum();
        if self.is_leaf(area, count, least) {
            return None;
        }
        let mut best = (f32::INFINITY, 0, [0; FEW]);
        for grid in grids.iter().flatten() {
            let order = in_order_of_bins(items, grid);
            let (cost, left_count) = self.best_plane_of_few(items, &order);
            if cost < best.0 || best.1 == 0 {
                best = (cost, left_count, order);
            }
        }
        let (cost, left_count, order) = best;
        if self.is_leaf(area, count, cost) {
            return None;
        }
        for (item, key) in spare.iter_mut().zip(order) {
            *item = items[(key & 0xff) as usize];
        }
        let side = |items: &[Item]| {
            let mut all = Unsplit::EMPTY;
            items.iter().for_each(|item| all.add(item));
            all
        };
        let (left, right) = spare.split_at(left_count);
        Some(Divided { left_count, is_moved: true, left: side(left), right: side(right) })
    }

    /// The cost of the best plane, and how many items are on its left, of items in the order of their bins.
    fn best_plane_of_few(&self, items: &[Item], order: &[u32; FEW]) -> Plane {
        let count = items.len();
        let item = |at: usize| &items[(order[at] & 0xff) as usize];
        let mut right_costs = [0.0; FEW];
        let mut bounds = Bounds::EMPTY;
        for at in (1..count).rev() {
            bounds = bounds.union(item(at).bounds());
            right_costs[at] = self.costs.leaf_cost(bounds.half_area(), (count - at) as u32);
        }
        let mut bounds = Bounds::EMPTY;
        let mut best = (f32::INFINITY, 0);
        for at in 1..count {
            bounds = bounds.union(item(at - 1).bounds());
            if order[at - 1] >> 8 != order[at] >> 8 {
                let cost = self.costs.leaf_cost(bounds.half_area(), at as u32) + right_costs[at];
                if cost < best.0 || best.1 == 0 {
                    best = (cost, at);
                }
            }
        }
        best
    }
}

/// Whether all threads work on a node together. One that has no others reads its items once, and in place.
fn is_for_all(items: &[Item]) -> bool {
    items.len() >= TOGETHER && rayon::current_num_threads() > 1
}

/// The bin of each item, and its place in the eight bits below, in the order of the bins.
fn in_order_of_bins(items: &[Item], grid: &Grid) -> [u32; FEW] {
    let mut order = [u32::MAX; FEW];
    for (i, item) in items.iter().enumerate() {
        let key = (grid.bin_of(item) << 8 | i) as u32;
        let mut at = i;
        while at > 0 && order[at - 1] > key {
            order[at] = order[at - 1];
            at -= 1;
        }
        order[at] = key;
    }
    order
}

/// Fills the bins of a grid, the first of `N`, by all threads if there are many items.
fn fill<const N: usize>(items: &[Item], grid: &Grid, bins: &mut [Bin; N]) {
    if !is_for_all(items) {
        return fill_alone(items, grid, bins);
    }
    let of_piece = |items: &[Item]| {
        let mut bins = [Bin::EMPTY; N];
        fill_alone(items, grid, &mut bins);
        bins
    };
    let union = |mut a: [Bin; N], b: [Bin; N]| {
        unite(&mut a, &b);
        a
    };
    *bins = items.par_chunks(PIECE).map(of_piece).reduce(|| [Bin::EMPTY; N], union);
}

/// The same by one thread.
fn fill_alone<const N: usize>(items: &[Item], grid: &Grid, bins: &mut [Bin; N]) {
    let add = |bins: &mut [Bin; N], item: &Item| {
        let bin = &mut bins[grid.bin_of(item)];
        bin.items.add(item);
        bin.count += 1;
    };
    bins[..grid.bins].fill(Bin::EMPTY);
    if items.len() < 4 * N {
        return items.iter().for_each(|item| add(bins, item));
    }
    // Neighbours often are in the same bin: two sets of bins, as the one need not wait for the other.
    let mut others = [Bin::EMPTY; N];
    let pairs = items.chunks_exact(2);
    pairs.remainder().iter().for_each(|item| add(bins, item));
    for pair in pairs {
        add(bins, &pair[0]);
        add(&mut others, &pair[1]);
    }
    unite(&mut bins[..grid.bins], &others[..grid.bins]);
}

/// Adds what is in other bins.
fn unite(bins: &mut [Bin], others: &[Bin]) {
    bins.iter_mut().zip(others).for_each(|(bin, other)| *bin = bin.union(*other));
}

/// Writes the `left_count` items that are on the left before the others, both in the order that they were in.
pub(super) fn partition(items: &[Item], to: &mut [Item], left_count: usize, is_left: impl Fn(&Item) -> bool + Sync) {
    if !is_for_all(items) {
        return spread(items, to, left_count, is_left);
    }
    let counts: Vec<usize> =
        items.par_chunks(PIECE).map(|piece| piece.iter().filter(|item| is_left(item)).count()).collect();
    let (mut left, mut right) = to.split_at_mut(left_count);
    let mut places = Vec::with_capacity(counts.len());
    for (piece, &on_left) in items.chunks(PIECE).zip(&counts) {
        let (left_place, left_rest) = left.split_at_mut(on_left);
        let (right_place, right_rest) = right.split_at_mut(piece.len() - on_left);
        places.push((piece, left_place, right_place));
        (left, right) = (left_rest, right_rest);
    }
    places.into_par_iter().for_each(|(piece, left, right)| {
        let (mut left, mut right) = (left.iter_mut(), right.iter_mut());
        for item in piece {
            let place = if is_left(item) { left.next() } else { right.next() };
            *place.expect("counted before") = *item;
        }
    });
}

/// The same by one thread.
fn spread(items: &[Item], to: &mut [Item], left_count: usize, is_left: impl Fn(&Item) -> bool) {
    let (mut left, mut right) = (0, left_count);
    for item in items {
        let is_left = is_left(item);
        // Chosen without a branch, which would be guessed wrongly half the time.
        to[if is_left { left } else { right }] = *item;
        left += usize::from(is_left);
        right += usize::from(!is_left);
    }
}
