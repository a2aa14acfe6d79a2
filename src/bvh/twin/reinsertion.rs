//! Parallel reinsertion, plainly: the twin of [`crate::bvh::reinsertion`], which describes the method.

use crate::Result;
use crate::bvh::flux::{FluxGrid, quotient};
use crate::bvh::layout::{Bvh2, Child, MAX_DEPTH, Record, node_slots, status};
use crate::bvh::reinsertion::{
    Areas, LEAST_GAIN, LEAST_SHARE, LEVELS, MOST_GAIN, Probed, ReinsertionOptions, STACK, VISITS, probed_offsets,
    weight_of,
};
use crate::geometry::Aabb;

const NONE: u32 = u32::MAX;

/// A move that would gain: the subtree at `link` to where `to` is.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Move {
    link: u32,
    to: u32,
    pivot: u32,
    gain: f32,
}

/// What the node with a box costs, as [`crate::bvh::reinsertion::Cost`] says it on the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CostOnHost<'a> {
    /// Its area.
    Area,
    /// Partly the rays that meet it.
    Rays {
        /// Of the rays.
        grid: &'a FluxGrid,
        /// Which part of the whole tree's cost is by rays.
        share: f32,
    },
}

impl<R: Record> Bvh2<R> {
    /// The tree, in which every leaf has one record, after the passes of `options`: the bytes of
    /// [`crate::bvh::reinsertion`].
    pub fn reinserted(&self, options: &ReinsertionOptions) -> Bvh2<R> {
        let scale = self.header.area_scale;
        self.after_rounds(options, 0, |bounds| bounds.scaled_half_area(scale), false)
    }

    /// The same by these areas, with a part of the scene.
    pub(super) fn reinserted_within(&self, options: &ReinsertionOptions, areas: Areas, part: &Aabb) -> Bvh2<R> {
        let scale = self.header.area_scale;
        let clipped = |bounds: &Aabb| {
            let lo: [f32; 3] = std::array::from_fn(|i| bounds.lo[i].max(part.lo[i]));
            let hi: [f32; 3] = std::array::from_fn(|i| bounds.hi[i].min(part.hi[i]));
            if (0..3).any(|i| hi[i] < lo[i]) { 0.0 } else { Aabb { lo, hi }.scaled_half_area(scale) }
        };
        let area = |bounds: &Aabb| match areas {
            Areas::Whole => bounds.scaled_half_area(scale),
            Areas::Clipped => clipped(bounds),
            Areas::Coarse if part.contains(bounds) => bounds.scaled_half_area(scale),
            Areas::Coarse if (0..3).any(|i| bounds.lo[i] > part.hi[i] || bounds.hi[i] < part.lo[i]) => 0.0,
            Areas::Coarse => part.scaled_half_area(scale),
        };
        self.after_rounds(options, 0, area, false)
    }

    /// The finished tree after the rounds of `options`, from `first_round` on: the bytes of
    /// [`record_rounds`](crate::bvh::reinsertion::Reinsertion::record_rounds).
    ///
    /// # Errors
    /// The share is out of range.
    pub fn reinserted_by(
        &self,
        options: &ReinsertionOptions,
        first_round: u32,
        cost: &CostOnHost<'_>,
    ) -> Result<Bvh2<R>> {
        let by_rays = *cost != CostOnHost::Area;
        let mut tree = self.after_rounds(options, first_round, self.cost_by(cost)?, by_rays);
        if !tree.header.root.is_leaf() && tree.is_too_deep() {
            tree.header.status |= status::TOO_DEEP;
        }
        Ok(tree)
    }

    /// What moves would gain: the numbers of [`record_probe`](crate::bvh::reinsertion::Reinsertion::record_probe).
    ///
    /// # Errors
    /// The share is out of range.
    pub fn probed(&self, options: &ReinsertionOptions, cost: &CostOnHost<'_>) -> Result<Probed> {
        let work = LinkedTree {
            parents: parents_of(self),
            tree: self.clone(),
            cost: self.cost_by(cost)?,
            by_rays: *cost != CostOnHost::Area,
        };
        let slots = node_slots(self.header.primitive_count);
        let (stride, links) = (options.stride_for(slots), 2 * self.nodes.len() as u32);
        let root_area = self.header.root.bounds().scaled_half_area(self.header.area_scale);
        let mut probed = Probed { root_area, ..Probed::default() };
        for link in probed_offsets(options.rounds_for(slots), stride)
            .flat_map(|offset| (offset..links).step_by(stride as usize))
        {
            probed.tried += 1;
            // Exact: a float below 2²⁴ has 32 bits behind the point at most that count. What is more counts as that.
            probed.gains +=
                work.search(link).map_or(0, |m| (f64::from(m.gain.min(16_777_215.0)) * 4_294_967_296.0) as u64);
        }
        Ok(probed)
    }

    fn after_rounds(
        &self,
        options: &ReinsertionOptions,
        first_round: u32,
        cost: impl Fn(&Aabb) -> f32,
        by_rays: bool,
    ) -> Bvh2<R> {
        let mut work = LinkedTree { parents: parents_of(self), tree: self.clone(), cost, by_rays };
        let slots = node_slots(self.header.primitive_count);
        let (rounds, stride) = (options.rounds_for(slots), options.stride_for(slots));
        for round in 0..rounds {
            work.round(first_round % stride + round, stride);
        }
        if rounds > 0 {
            work.tree.header.child_order = 0;
            return work.tree.with_nothing_far();
        }
        work.tree
    }

    fn cost_by<'c>(&self, cost: &CostOnHost<'c>) -> Result<impl Fn(&Aabb) -> f32 + use<'c, R>> {
        let scale = self.header.area_scale;
        let (grid, ratio) = match *cost {
            CostOnHost::Area => (None, 0.0),
            CostOnHost::Rays { grid, share } => (Some(grid), self.ratio(grid, weight_of(share)?)),
        };
        Ok(move |bounds: &Aabb| {
            let area = bounds.scaled_half_area(scale);
            grid.map_or(area, |grid| area + ratio * grid.rays(bounds))
        })
    }

    /// What the area of all nodes is to the rays that meet them, times `weight`. Without rays or area nothing.
    fn ratio(&self, grid: &FluxGrid, weight: f32) -> f32 {
        let boxes = self.nodes.iter().filter(|node| node.is_used());
        let boxes = boxes.map(|node| node.children[0].bounds().union(&node.children[1].bounds()));
        let (mut area, mut rays) = (0u64, 0u64);
        for bounds in boxes {
            area += (bounds.scaled_half_area(self.header.area_scale).min(MOST_AREA) * PARTS_OF_AREA) as u64;
            rays += (grid.rays(&bounds) * PARTS_OF_RAYS) as u64;
        }
        if area == 0 || rays == 0 || weight == 0.0 {
            return 0.0;
        }
        quotient(weight * leading(area, 1.0 / PARTS_OF_AREA), leading(rays, 1.0 / PARTS_OF_RAYS))
    }

    /// Whether a child is deeper than tracers can walk.
    fn is_too_deep(&self) -> bool {
        let mut open = vec![(self.header.root, 0)];
        while let Some((child, depth)) = open.pop() {
            if depth > MAX_DEPTH {
                return true;
            }
            if !child.is_leaf() && self.header.active > 0 {
                open.extend(self.nodes[child.index as usize].children.map(|below| (below, depth + 1)));
            }
        }
        false
    }
}

/// In which area and rays of all nodes are added up.
const PARTS_OF_AREA: f32 = (1u64 << 24) as f32;
/// What is larger counts as this: of what is far from where most is.
const MOST_AREA: f32 = 255.0;
const PARTS_OF_RAYS: f32 = 256.0;

/// The first 24 bits of a sum, in its unit.
fn leading(sum: u64, unit: f32) -> f32 {
    let shift = (40 - sum.leading_zeros() as i32).max(0);
    (sum >> shift) as f32 * unit * f32::from_bits((127 + shift as u32) << 23)
}

/// Of each slot, the link that names it.
fn parents_of<R: Record>(tree: &Bvh2<R>) -> Vec<u32> {
    let mut parents = vec![NONE; tree.nodes.len()];
    for (slot, node) in tree.nodes.iter().enumerate().filter(|(_, node)| node.is_used()) {
        for (side, child) in node.children.iter().enumerate().filter(|(_, child)| !child.is_leaf()) {
            parents[child.index as usize] = (2 * slot + side) as u32;
        }
    }
    parents
}

struct LinkedTree<R: Record, C> {
    tree: Bvh2<R>,
    parents: Vec<u32>,
    /// Of the node with a box.
    cost: C,
    /// Whether that takes a grid, which is asked where it must be.
    by_rays: bool,
}

impl<R: Record, C: Fn(&Aabb) -> f32> LinkedTree<R, C> {
    /// A round; how many subtrees it has moved.
    fn round(&mut self, round: u32, stride: u32) -> usize {
        let links = 2 * self.tree.nodes.len() as u32;
        let moves: Vec<Move> =
            (round % stride..links).step_by(stride as usize).filter_map(|link| self.search(link)).collect();
        // Of the moves across each node, the largest gain; and of the moves with it, the first.
        let mut gains = vec![0.0f32; self.tree.nodes.len()];
        let mut first = vec![NONE; self.tree.nodes.len()];
        for (m, slot) in moves.iter().flat_map(|m| self.path(m).map(move |slot| (m, slot as usize))) {
            gains[slot] = gains[slot].max(m.gain);
        }
        for (m, slot) in moves.iter().flat_map(|m| self.path(m).map(move |slot| (m, slot as usize))) {
            if gains[slot] == m.gain {
                first[slot] = first[slot].min(m.link);
            }
        }
        let wins = |m: &&Move| self.path(m).all(|slot| first[slot as usize] == m.link);
        let won: Vec<Move> = moves.iter().filter(wins).copied().collect();
        for m in &won {
            self.make(m);
        }
        won.len()
    }

    fn child(&self, link: u32) -> Child {
        self.tree.nodes[link as usize / 2].children[link as usize % 2]
    }

    fn child_mut(&mut self, link: u32) -> &mut Child {
        &mut self.tree.nodes[link as usize / 2].children[link as usize % 2]
    }

    fn cost(&self, bounds: &Aabb) -> f32 {
        (self.cost)(bounds)
    }

    /// The box of the node in a slot.
    fn bounds(&self, slot: u32) -> Aabb {
        self.child(2 * slot).bounds().union(&self.child(2 * slot + 1).bounds())
    }

    /// The box by which the node in a slot has its cost. By rays costs are kept for what hangs from a link.
    fn bounds_by(&self, slot: u32) -> Aabb {
        let is_root = slot == self.tree.header.root.index;
        if self.by_rays && !is_root { self.child(self.parents[slot as usize]).bounds() } else { self.bounds(slot) }
    }

    /// The node above another.
    fn above(&self, slot: u32) -> u32 {
        self.parents[slot as usize] / 2
    }

    /// The best move of the subtree at `link`, if one gains.
    fn search(&self, link: u32) -> Option<Move> {
        let (parent, root) = (link / 2, self.tree.header.root.index);
        if !self.tree.nodes[parent as usize].is_used() || parent == root {
            return None;
        }
        let moving = self.child(link).bounds();
        let mut best = Move { link, to: NONE, pivot: NONE, gain: 0.0 };
        let mut visits = 0;
        // What all nodes cost less, without a new one; so far, the parent's cost.
        let mut saved = self.cost(&self.bounds_by(parent));
        // What is left below the pivot on the side that the subtree leaves.
        let mut left_behind = Aabb::EMPTY;
        let mut at = link;
        for _ in 0..LEVELS {
            let pivot = at / 2;
            let pivot_cost = self.cost(&self.bounds_by(pivot));
            self.search_below(at ^ 1, (pivot, pivot_cost), saved, &moving, (&mut best, &mut visits));
            if pivot == root {
                break;
            }
            left_behind = left_behind.union(&self.child(at ^ 1).bounds());
            // What is inside of a box, and does not touch its faces, leaves it as it is.
            if pivot != parent && !(self.by_rays && left_behind == self.bounds(pivot)) {
                saved += pivot_cost - self.cost(&left_behind);
            }
            at = self.parents[pivot as usize];
        }
        best.gain = best.gain.min(MOST_GAIN);
        (best.to != NONE).then_some(best)
    }

    /// Looks at the subtree at link `at`, on the other side of the pivot.
    fn search_below(
        &self,
        at: u32,
        (pivot, pivot_cost): (u32, f32),
        saved: f32,
        moving: &Aabb,
        (best, visits): (&mut Move, &mut u32),
    ) {
        let moving_cost = self.cost(moving);
        let scale = self.tree.header.area_scale;
        let (link, by_rays) = (best.link, |bounds: &Aabb, cost: f32| cost - bounds.scaled_half_area(scale));
        let bar = |best: &Move| best.gain.max((LEAST_SHARE * pivot_cost).max(LEAST_GAIN));
        let below = |child: &Child, saved: f32, merged: f32| {
            let left = saved - (merged - self.cost(&child.bounds()));
            (if child.is_leaf() { NONE } else { child.index }, left)
        };
        // What a move to `at` would gain; and of the node there, the slot and what would be saved if the move went below.
        let look = |at: u32, saved: f32, best: &mut Move| {
            let child = self.child(at);
            let bounds = child.bounds().union(moving);
            if self.by_rays {
                let own = self.cost(&child.bounds());
                let least =
                    bounds.scaled_half_area(scale) + by_rays(&child.bounds(), own).max(by_rays(moving, moving_cost));
                let is_useless_below = child.is_leaf() || saved - (least - own) - moving_cost <= bar(best);
                if saved - least <= bar(best) && is_useless_below {
                    return (NONE, 0.0);
                }
            }
            let merged = self.cost(&bounds);
            let gain = saved - merged;
            if gain > bar(best) {
                *best = Move { link, to: at, pivot, gain };
            }
            below(&child, saved, merged)
        };
        // The new node has at least the cost of what moves.
        let may_gain = |(slot, saved): (u32, f32), best: &Move| slot != NONE && saved - moving_cost > bar(best);
        // A move beside the own sibling would tie a cycle. It is never looked at: the box around both is the parent's.
        let first = if at == link ^ 1 { below(&self.child(at), saved, pivot_cost) } else { look(at, saved, best) };
        let mut stack = vec![first];
        while let Some(next) = stack.pop() {
            if *visits == VISITS {
                break;
            }
            if !may_gain(next, best) {
                continue;
            }
            *visits += 1;
            let (slot, saved) = next;
            let [left, right] = [0, 1].map(|side| look(2 * slot + side, saved, best));
            let [near, far] = if right.1 > left.1 { [right, left] } else { [left, right] };
            for next in [far, near] {
                if may_gain(next, best) && stack.len() < STACK {
                    stack.push(next);
                }
            }
        }
    }

    /// The nodes that a move changes: from the parent up to the pivot, and to the node above the parent in any case; and from the
    /// new place up to the pivot.
    fn path(&self, m: &Move) -> impl Iterator<Item = u32> {
        let (pivot, top) = (m.pivot, self.top(m));
        let climb = |from: u32| std::iter::successors(Some(from), |&slot| Some(self.above(slot)));
        climb(m.link / 2)
            .take_while(move |&slot| slot != top)
            .chain([top])
            .chain(climb(m.to / 2).take_while(move |&slot| slot != pivot))
    }

    /// The highest node that a move changes.
    fn top(&self, m: &Move) -> u32 {
        if m.pivot == m.link / 2 { self.above(m.pivot) } else { m.pivot }
    }

    fn make(&mut self, m: &Move) {
        let (parent, top) = (m.link / 2, self.top(m));
        let up = self.parents[parent as usize];
        let moving = self.child(m.link).bounds();
        // The sibling takes the parent's place, and all up to the pivot shrink.
        self.hang(self.child(m.link ^ 1), up);
        let mut at = up;
        while at / 2 != top {
            let bounds = self.bounds(at / 2);
            at = self.parents[at as usize / 2];
            self.set_box(at, &bounds);
        }
        // The parent takes the new place, with what was there as its other child, and all up to the pivot grow.
        self.hang(self.child(m.to), m.link ^ 1);
        self.hang(Child { index: parent, count: 0, ..self.child(m.to) }, m.to);
        let mut at = m.to;
        loop {
            self.set_box(at, &self.child(at).bounds().union(&moving));
            if at / 2 == top {
                break;
            }
            at = self.parents[at as usize / 2];
        }
    }

    /// Puts a subtree to a link.
    fn hang(&mut self, child: Child, link: u32) {
        *self.child_mut(link) = child;
        if !child.is_leaf() {
            self.parents[child.index as usize] = link;
        }
    }

    fn set_box(&mut self, link: u32, bounds: &Aabb) {
        let child = self.child_mut(link);
        (child.lo, child.hi) = (bounds.lo, bounds.hi);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::codes::Code;
    use crate::bvh::sah::Collapse;
    use crate::bvh::twin::lbvh;
    use std::cell::Cell;

    /// Every box costs 1 but the fourth that a search asks for. Who looks at the own sibling asks for the box around both then, and finds
    /// the only move that gains; making it would hang the parent below itself. Who does not asks for the sibling's own.
    #[test]
    fn a_subtree_does_not_move_to_where_it_is() {
        let corner = |i: usize| {
            let [x, y, z] = [7919 * i % 101, 6101 * i % 97, 4001 * i % 89].map(|k| k as f32);
            [[x, y, z], [x + 1.0, y, z], [x, y + 1.0, z]]
        };
        let positions: Vec<[f32; 3]> = (0..64).flat_map(corner).collect();
        let triangles: Vec<[u32; 3]> = (0..64).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let tree = lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::OFF);
        let asked = Cell::new(0u32);
        let cost = |_: &Aabb| {
            asked.set(asked.get() + 1);
            if asked.get() == 4 { 0.5 } else { 1.0 }
        };
        let work = LinkedTree { parents: parents_of(&tree), tree: tree.clone(), cost, by_rays: false };
        for link in 0..2 * tree.nodes.len() as u32 {
            asked.set(0);
            assert!(work.search(link).is_none(), "link {link} moves");
        }
    }

    /// Triangles stand in a row in the order of their numbers, but for one. As another is so far that the row is in one cell, the tree halves it
    /// by number: the node over both places of the one is as many levels up as the numbers have bits from the highest that differs. Where that
    /// is too far, most of the way is better than none.
    #[test]
    fn a_search_goes_up_through_ten_pivots_and_no_more() {
        for (levels, expected) in [(2, 2), (LEVELS, LEVELS), (LEVELS + 1, LEVELS)] {
            let stray = 5usize;
            let corner = |i: usize| {
                let x = match i {
                    4096 => 1e7,
                    _ if i == stray => (i ^ 1 << (levels - 1)) as f32 + 0.1,
                    _ => i as f32,
                };
                [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 1.0, 0.0]]
            };
            let positions: Vec<[f32; 3]> = (0..4097).flat_map(corner).collect();
            let triangles: Vec<[u32; 3]> = (0..4097).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let tree = lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::OFF);
            let area = |bounds: &Aabb| bounds.scaled_half_area(tree.header.area_scale);
            let work = LinkedTree { parents: parents_of(&tree), tree: tree.clone(), cost: area, by_rays: false };
            let is_stray = |link: &u32| work.child(*link).is_leaf() && work.child(*link).index == stray as u32;
            let link = (0..2 * tree.nodes.len() as u32).find(is_stray).expect("a leaf");
            let pivots = work.search(link).map(|m| {
                let way = std::iter::successors(Some(link / 2), |&slot| Some(work.above(slot)));
                1 + way.take_while(|&slot| slot != m.pivot).count()
            });
            assert_eq!(pivots, Some(expected), "{levels} levels");
        }
    }

    #[test]
    fn a_sum_has_its_first_24_bits() {
        for (sum, expected) in
            [(1, 1.0), (0xFF_FFFF, 16_777_215.0), (0x1FF_FFFF, 33_554_430.0), (1 << 40, 1.099_511_6e12)]
        {
            assert_eq!(leading(sum, 1.0), expected);
        }
    }
}
