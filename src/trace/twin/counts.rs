//! Counts of rays by the links of a tree, plainly: the same numbers as [`crate::trace::counts`] counts on the device.

use crate::bvh::counts::LinkCount;
use crate::bvh::layout::{Bvh2, Child, status};
use crate::bvh::sah::Collapse;
use crate::trace::counts::{CountedWalk, whole_costs};
use crate::trace::ray::PreparedRay;
use crate::trace::twin::tracer::{LONG_LEAF, Nearest};
use crate::trace::{Query, Ray, slab};

/// Adds what these rays do in `tree` to `counts`, two for each of its node slots. A tree that cannot be traced, or whose root is a leaf,
/// has no links.
///
/// # Panics
/// There are fewer counts than links.
pub fn count<'r>(
    tree: &Bvh2,
    rays: impl IntoIterator<Item = &'r Ray>,
    walk: CountedWalk,
    costs: &Collapse,
    counts: &mut [LinkCount],
) {
    assert!(counts.len() >= 2 * tree.nodes.len(), "two counts a node slot");
    let root = tree.header.root;
    if tree.header.active == 0 || tree.header.status & status::UNUSABLE != 0 || root.is_leaf() {
        return;
    }
    let [c_t, c_i] = whole_costs(costs);
    let mut counting = Counting { tree, walk, c_t, c_i, counts };
    for ray in rays {
        if let Some(prepared) = PreparedRay::new(ray) {
            counting.children_of(root.index, &prepared, &mut Nearest::new(ray.t_max));
        }
    }
}

/// Halves all counts, rounded down: what is counted next weighs as much as all that was before.
pub fn halve(counts: &mut [LinkCount]) {
    for LinkCount { entered, hits, work } in counts {
        (*entered, *hits, *work) = (*entered / 2, *hits / 2, *work / 2);
    }
}

struct Counting<'a> {
    tree: &'a Bvh2,
    walk: CountedWalk,
    c_t: u32,
    c_i: u32,
    counts: &'a mut [LinkCount],
}

/// What one ray does in a subtree.
#[derive(Clone, Copy, Default)]
struct Done {
    has_hit: bool,
    work: u32,
}

impl Counting<'_> {
    /// No deeper than tracers walk.
    fn children_of(&mut self, slot: u32, ray: &PreparedRay, nearest: &mut Nearest) -> Done {
        let children = self.tree.nodes[slot as usize].children;
        let enters = children.map(|child| slab::enter(ray, &child.bounds(), nearest.t));
        let right_first = match enters.into() {
            (Some(left), Some(right)) => right < left,
            (left, _) => left.is_none(),
        };
        let mut done = Done::default();
        for (place, side) in if right_first { [1, 0] } else { [0, 1] }.into_iter().enumerate() {
            let Some(enter) = enters[side] else { continue };
            // As tracers do: equally far is not too far, and a long leaf is taken however far it is.
            let is_too_far = place == 1 && children[side].count < LONG_LEAF && enter > nearest.t;
            let is_over = self.walk == CountedWalk::AsTraced(Query::AnyHit) && nearest.hit.is_some();
            if !is_too_far && !is_over {
                let of_child = self.link(2 * slot + side as u32, &children[side], ray, nearest);
                done.has_hit |= of_child.has_hit;
                done.work = done.work.saturating_add(of_child.work);
            }
        }
        done
    }

    fn link(&mut self, link: u32, child: &Child, ray: &PreparedRay, nearest: &mut Nearest) -> Done {
        let mut done = match child.is_leaf() {
            true => self.leaf(child, ray, nearest),
            false => self.children_of(child.index, ray, nearest),
        };
        if !child.is_leaf() {
            done.work = done.work.saturating_add(self.c_t);
        }
        let count = &mut self.counts[link as usize];
        count.entered = count.entered.saturating_add(1);
        count.hits = count.hits.saturating_add(done.has_hit.into());
        count.work = count.work.saturating_add(done.work);
        done
    }

    fn leaf(&mut self, leaf: &Child, ray: &PreparedRay, nearest: &mut Nearest) -> Done {
        let mut has_hit = false;
        for triangle in &self.tree.records[leaf.index as usize..][..leaf.count as usize] {
            let before = nearest.hit;
            nearest.consider(ray, triangle);
            if nearest.hit == before {
                continue;
            }
            has_hit = true;
            match self.walk {
                CountedWalk::AsTraced(Query::ClosestHit) => {}
                CountedWalk::AsTraced(Query::AnyHit) => break,
                CountedWalk::Exhaustive => *nearest = Nearest::new(ray.t_max),
            }
        }
        Done { has_hit, work: self.c_i.saturating_mul(leaf.count) }
    }
}
