//! Reinsertion as `hedgerow::bvh::twin::reinsertion` does it, with any measure of what a box costs in place of its area.

use hedgerow::bvh::layout::{Bvh2, Child};
use hedgerow::geometry::Aabb;
use rayon::prelude::*;

const NONE: u32 = u32::MAX;
const STACK: usize = 32;
const PATH: usize = 256;
const LEAST_SHARE: f32 = 1.0 / 1_048_576.0;
const LEAST_GAIN: f32 = 1.0 / 1_152_921_504_606_846_976.0;

/// What boxes cost.
pub trait Measure: Sync {
    /// What is known of the rays in a box that a search goes below.
    type Here: Copy;

    /// Looks at the tree before a round.
    fn prepare(&mut self, tree: &LinkedTree, round: u32);
    /// The node in a slot.
    fn node(&self, tree: &LinkedTree, slot: u32) -> f32;
    /// What moves, at least.
    fn moving(&self, tree: &LinkedTree, link: u32) -> f32;
    /// The node in a slot, if only `left` of it stays, which holds what is at link `other`.
    fn shrunk(&self, tree: &LinkedTree, slot: u32, other: u32, left: &Aabb) -> f32;
    /// The rays in a pivot.
    fn begin(&self, tree: &LinkedTree, pivot: u32, buffer: &mut Vec<u32>) -> Self::Here;
    /// A box around what is at `at` and what moves from `link`, in a box that `here` is of.
    fn merged(
        &self,
        tree: &LinkedTree,
        here: Self::Here,
        links: [u32; 2],
        merged: &Aabb,
        buffer: &mut Vec<u32>,
    ) -> (f32, Self::Here);
    /// A move is made: what is at `link` comes beside what is at `to`; `up` names its parent.
    fn moves(&mut self, _tree: &LinkedTree, _m: &Move, _top: u32) {}
}

/// A move that would gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    pub link: u32,
    pub to: u32,
    pub pivot: u32,
    pub gain: f32,
}

/// A tree whose nodes know their parents.
pub struct LinkedTree {
    pub tree: Bvh2,
    pub parents: Vec<u32>,
}

struct Below<H> {
    slot: u32,
    saved: f32,
    here: Option<H>,
}

impl LinkedTree {
    pub fn new(tree: Bvh2) -> LinkedTree {
        let mut parents = vec![NONE; tree.nodes.len()];
        for (slot, node) in tree.nodes.iter().enumerate().filter(|(_, node)| node.is_used()) {
            for (side, child) in node.children.iter().enumerate().filter(|(_, child)| !child.is_leaf()) {
                parents[child.index as usize] = (2 * slot + side) as u32;
            }
        }
        LinkedTree { tree, parents }
    }

    /// Every so many links in a round.
    pub fn stride(&self) -> u32 {
        64.min(2 * self.tree.nodes.len() as u32 / 128).max(1)
    }

    /// Of links that `offset` and the stride give, the best moves.
    pub fn moves<M: Measure>(&self, measure: &M, offset: u32, stride: u32) -> Vec<Move> {
        let links = 2 * self.tree.nodes.len() as u32;
        let tried: Vec<u32> = (offset..links).step_by(stride as usize).collect();
        tried
            .par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |buffer, &link| self.search(measure, link, buffer))
            .flatten()
            .collect()
    }

    pub fn round<M: Measure>(&mut self, measure: &mut M, round: u32) -> usize {
        measure.prepare(self, round);
        let won = self.settled(&self.moves(measure, round % self.stride(), self.stride()));
        for m in &won {
            measure.moves(self, m, self.top(m));
            self.make(m);
        }
        won.len()
    }

    /// Those that are first on all nodes of their path.
    pub fn settled(&self, moves: &[Move]) -> Vec<Move> {
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
        moves.iter().filter(wins).copied().collect()
    }

    pub fn child(&self, link: u32) -> Child {
        self.tree.nodes[link as usize / 2].children[link as usize % 2]
    }

    fn child_mut(&mut self, link: u32) -> &mut Child {
        &mut self.tree.nodes[link as usize / 2].children[link as usize % 2]
    }

    pub fn area(&self, bounds: &Aabb) -> f32 {
        bounds.scaled_half_area(self.tree.header.area_scale)
    }

    pub fn bounds(&self, slot: u32) -> Aabb {
        self.child(2 * slot).bounds().union(&self.child(2 * slot + 1).bounds())
    }

    pub fn above(&self, slot: u32) -> u32 {
        self.parents[slot as usize] / 2
    }

    fn search<M: Measure>(&self, measure: &M, link: u32, buffer: &mut Vec<u32>) -> Option<Move> {
        let (parent, root) = (link / 2, self.tree.header.root.index);
        if !self.tree.nodes[parent as usize].is_used() || parent == root {
            return None;
        }
        let mut best = Move { link, to: NONE, pivot: NONE, gain: 0.0 };
        let mut saved = measure.node(self, parent);
        let mut left_behind = Aabb::EMPTY;
        let mut at = link;
        for _ in 0..PATH {
            let pivot = at / 2;
            let pivot_cost = measure.node(self, pivot);
            self.search_below(measure, at ^ 1, [pivot_cost, saved], &mut best, buffer);
            if pivot == root {
                break;
            }
            left_behind = left_behind.union(&self.child(at ^ 1).bounds());
            if pivot != parent {
                saved += pivot_cost - measure.shrunk(self, pivot, at ^ 1, &left_behind);
            }
            at = self.parents[pivot as usize];
        }
        (best.to != NONE && self.is_path_walkable(&best)).then_some(best)
    }

    fn search_below<M: Measure>(
        &self,
        measure: &M,
        at: u32,
        [pivot_cost, saved]: [f32; 2],
        best: &mut Move,
        buffer: &mut Vec<u32>,
    ) {
        let (link, pivot) = (best.link, at / 2);
        let moving = self.child(link).bounds();
        let least = measure.moving(self, link);
        let bar = |best: &Move| best.gain.max((LEAST_SHARE * pivot_cost).max(LEAST_GAIN));
        if saved - least <= bar(best) {
            return;
        }
        buffer.clear();
        let begin = measure.begin(self, pivot, buffer);
        let mut look = |at: u32, saved: f32, here: M::Here, best: &mut Move| {
            // Nothing can be gained there.
            if saved - least <= bar(best) {
                return Below { slot: NONE, saved, here: None };
            }
            let child = self.child(at);
            // Beside its sibling it is already, in the parent's box.
            let stays = at == link ^ 1;
            let (merged, here) = if stays {
                (pivot_cost, here)
            } else {
                measure.merged(self, here, [at, link], &child.bounds().union(&moving), buffer)
            };
            let gain = saved - merged;
            if gain > bar(best) && !stays {
                *best = Move { link, to: at, pivot, gain };
            }
            if child.is_leaf() {
                return Below { slot: NONE, saved, here: None };
            }
            Below { slot: child.index, saved: saved - (merged - measure.node(self, child.index)), here: Some(here) }
        };
        let may_gain = |next: &Below<M::Here>, best: &Move| next.slot != NONE && next.saved - least > bar(best);
        let mut stack = vec![look(at, saved, begin, best)];
        while let Some(next) = stack.pop() {
            if !may_gain(&next, best) {
                continue;
            }
            let Some(here) = next.here else { continue };
            let [left, right] = [0, 1].map(|side| look(2 * next.slot + side, next.saved, here, best));
            let [near, far] = if right.saved > left.saved { [right, left] } else { [left, right] };
            for next in [far, near] {
                if may_gain(&next, best) && stack.len() < STACK {
                    stack.push(next);
                }
            }
        }
    }

    fn is_path_walkable(&self, m: &Move) -> bool {
        std::iter::successors(Some(m.to / 2), |&slot| Some(self.above(slot))).take(PATH).any(|slot| slot == m.pivot)
    }

    fn path(&self, m: &Move) -> impl Iterator<Item = u32> {
        let (pivot, top) = (m.pivot, self.top(m));
        let climb = |from: u32| std::iter::successors(Some(from), |&slot| Some(self.above(slot)));
        climb(m.link / 2)
            .take_while(move |&slot| slot != top)
            .chain([top])
            .chain(climb(m.to / 2).take_while(move |&slot| slot != pivot))
    }

    pub fn top(&self, m: &Move) -> u32 {
        if m.pivot == m.link / 2 { self.above(m.pivot) } else { m.pivot }
    }

    fn make(&mut self, m: &Move) {
        let (parent, top) = (m.link / 2, self.top(m));
        let up = self.parents[parent as usize];
        let moving = self.child(m.link).bounds();
        self.hang(self.child(m.link ^ 1), up);
        let mut at = up;
        while at / 2 != top {
            let bounds = self.bounds(at / 2);
            at = self.parents[at as usize / 2];
            self.set_box(at, &bounds);
        }
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
