//! Parallel reinsertion, plainly: the twin of [`crate::bvh::reinsertion`], which describes the method.

use crate::bvh::layout::{Bvh2, Child, Record};
use crate::bvh::reinsertion::{LEAST_GAIN, LEAST_SHARE, PATH, ReinsertionOptions, STACK};
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

impl<R: Record> Bvh2<R> {
    /// The tree, in which every leaf has one record, after the passes of `options`: the bytes of
    /// [`crate::bvh::reinsertion`].
    pub fn reinserted(&self, options: &ReinsertionOptions) -> Bvh2<R> {
        let mut work = LinkedTree { parents: parents_of(self), tree: self.clone() };
        let slots = self.nodes.len() as u32;
        for round in 0..options.rounds_for(slots) {
            work.round(round, options.stride_for(slots));
        }
        work.tree
    }
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

struct LinkedTree<R: Record> {
    tree: Bvh2<R>,
    parents: Vec<u32>,
}

impl<R: Record> LinkedTree<R> {
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

    fn area(&self, bounds: &Aabb) -> f32 {
        bounds.scaled_half_area(self.tree.header.area_scale)
    }

    /// The box of the node in a slot.
    fn bounds(&self, slot: u32) -> Aabb {
        self.child(2 * slot).bounds().union(&self.child(2 * slot + 1).bounds())
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
        // What all nodes shorten by, less the area of a new one; so far, the parent's area.
        let mut saved = self.area(&self.bounds(parent));
        // What is left below the pivot on the side that the subtree leaves.
        let mut left_behind = Aabb::EMPTY;
        let mut at = link;
        for _ in 0..PATH {
            let pivot = at / 2;
            let pivot_area = self.area(&self.bounds(pivot));
            self.search_below(at ^ 1, pivot, saved, pivot_area, &moving, &mut best);
            if pivot == root {
                break;
            }
            left_behind = left_behind.union(&self.child(at ^ 1).bounds());
            if pivot != parent {
                saved += pivot_area - self.area(&left_behind);
            }
            at = self.parents[pivot as usize];
        }
        (best.to != NONE && self.is_path_walkable(&best)).then_some(best)
    }

    /// Looks at the subtree at link `at`, on the other side of the pivot.
    fn search_below(&self, at: u32, pivot: u32, saved: f32, pivot_area: f32, moving: &Aabb, best: &mut Move) {
        let moving_area = self.area(moving);
        let link = best.link;
        let bar = |best: &Move| best.gain.max((LEAST_SHARE * pivot_area).max(LEAST_GAIN));
        // What a move to `at` would gain; and of the node there, the slot and what would be saved if the move went below.
        let look = |at: u32, saved: f32, best: &mut Move| {
            let child = self.child(at);
            let merged = self.area(&child.bounds().union(moving));
            let gain = saved - merged;
            if gain > bar(best) {
                *best = Move { link, to: at, pivot, gain };
            }
            let below = saved - (merged - self.area(&child.bounds()));
            (if child.is_leaf() { NONE } else { child.index }, below)
        };
        // The new node has at least the area of what moves.
        let may_gain = |(slot, saved): (u32, f32), best: &Move| slot != NONE && saved - moving_area > bar(best);
        let mut stack = vec![look(at, saved, best)];
        while let Some(next) = stack.pop() {
            if !may_gain(next, best) {
                continue;
            }
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

    /// Whether the new place is no more than [`PATH`] nodes below the pivot.
    fn is_path_walkable(&self, m: &Move) -> bool {
        std::iter::successors(Some(m.to / 2), |&slot| Some(self.above(slot))).take(PATH).any(|slot| slot == m.pivot)
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
