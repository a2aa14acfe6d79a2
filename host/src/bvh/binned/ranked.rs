//! The best few planes between bins, and the tree by those that look ahead.

use super::bins::{Grid, fill, place_of};
use super::{Binned, BinnedOptions, Bins, FEW, Part, Plane, Split, halves, tree_over};
use crate::bvh::bounds::Item;
use crate::bvh::heuristic::split_cost::{Area, Side};
use crate::bvh::look_ahead::{LookAhead, Ranked};
use crate::bvh::top_down::{self, Candidates, LeafRule};
use crate::bvh::topology::Topology;

/// The most bins along an axis.
const MOST: usize = Bins::MOST as usize;

/// The tree over `items` by surface area, of whose splits at most `most` are judged at a node. `scale` is what their lengths were scaled
/// by.
pub(in crate::bvh) fn build_ahead(
    items: Vec<Item>,
    scale: f32,
    rule: LeafRule<'_>,
    options: &BinnedOptions,
    most: u32,
) -> Topology {
    let binned = Binned::new(scale, rule, options);
    let ahead = LookAhead::new(&binned, rule, most);
    tree_over(items, |whole| top_down::build(&ahead, &Area, whole))
}

impl Ranked for Binned<'_> {
    fn cheapest(&self, part: &mut Part<'_>, depth: u32, most: usize) -> Vec<Split> {
        let grids: Vec<Grid> = self.grids(part, depth).into_iter().flatten().collect();
        if self.is_told_a_leaf(part) || grids.is_empty() || part.items.len() <= FEW {
            return self.best(&Area, &(), part, depth).into_iter().collect();
        }
        let search = self.search(&Area, &(), part);
        let mut all: Vec<(Plane, usize)> = Vec::new();
        let mut bins = vec![[Side::EMPTY; MOST]; grids.len()];
        fill(&Area, part.items, &grids, &mut bins);
        for (at, (grid, bins)) in grids.iter().zip(&bins).enumerate() {
            let bins = &bins[..grid.bins];
            // A plane behind an empty bin splits as the one before does.
            let planes = search.planes::<MOST>(bins).filter(|&(_, plane)| bins[plane - 1].count > 0);
            all.extend(planes.map(|plane| (plane, at)));
        }
        // Of equal ones the first, along the first axis.
        all.sort_by(|a, b| a.0.0.total_cmp(&b.0.0));
        if all.first().is_none_or(|&((cost, _), _)| search.is_leaf(cost)) {
            return Vec::new();
        }
        let side = |bins: &[Side]| bins.iter().copied().fold(Side::EMPTY, Side::union);
        let split = |&((_, bin), at): &(Plane, usize)| {
            let (left, right) = bins[at][..grids[at].bins].split_at(bin);
            Split::AtBin { grid: grids[at], bin, sides: [side(left), side(right)] }
        };
        all.iter().take(most).map(split).collect()
    }

    fn copies(&self, part: &Part<'_>, split: &Split) -> [Vec<Item>; 2] {
        let items = &*part.items;
        match split {
            Split::Halved => halves(items).map(<[Item]>::to_vec),
            Split::AtBin { grid, bin, .. } => items.iter().partition(|item| grid.bin_of(item) < *bin).into(),
            Split::OfFew { order, left_count } => {
                let (left, right) = order[..items.len()].split_at(*left_count);
                [left, right].map(|keys| keys.iter().map(|key| items[place_of(*key)]).collect())
            }
        }
    }
}
