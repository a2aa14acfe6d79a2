//! The tracer of wide trees on the host: the same traversals and arithmetic as `glsl/trace/walk_wide.glsl` and
//! `glsl/trace/walk_quantised.glsl`.

use super::tracer::{LONG_LEAF, Nearest};
use crate::bvh::layout::{Child, status};
use crate::bvh::wide::layout::{Slots, Wide, WideNode};
use crate::bvh::wide::quantised::QuantisedNode;
use crate::trace::ray::PreparedRay;
use crate::trace::wide::Order;
use crate::trace::{Hit, Query, Ray, Work, slab};

/// A node whose children rays enter.
pub trait TracedNode: WideNode {
    /// Where the ray enters the boxes of the children, by their slots; nothing where it does not between `t_min` and `t_best`, and
    /// whatever comes to it where there is no child.
    fn enters(&self, ray: &PreparedRay, t_best: f32) -> [Option<f32>; 8];
}

impl<const W: usize> TracedNode for [Child; W]
where
    [Child; W]: WideNode,
{
    fn enters(&self, ray: &PreparedRay, t_best: f32) -> [Option<f32>; 8] {
        std::array::from_fn(|slot| slab::enter(ray, &self.get(slot)?.bounds(), t_best))
    }
}

impl TracedNode for QuantisedNode {
    /// The slack is that of the node's whole grid, and goes to where bytes are counted from.
    fn enters(&self, ray: &PreparedRay, t_best: f32) -> [Option<f32>; 8] {
        let (origin, cell) = self.grid();
        let least: [f32; 3] = std::array::from_fn(|i| origin[i] - ray.origin[i]);
        let farthest = (0..3).map(|i| (least[i] + 255.0 * cell[i]).max(-least[i]));
        let slack = slab::slack_of(ray, farthest.fold(f32::NEG_INFINITY, f32::max));
        std::array::from_fn(|slot| {
            let [lo, hi] = self.bytes(slot);
            let lo = |i: usize| ((least[i] - slack) + lo[i] * cell[i]) * ray.inverse[i];
            let hi = |i: usize| ((least[i] + slack) + hi[i] * cell[i]) * ray.inverse[i];
            let near = (0..3).fold(ray.t_min, |t, i| t.max(lo(i).min(hi(i))));
            let far = (0..3).fold(t_best, |t, i| t.min(lo(i).max(hi(i))));
            (near <= far).then_some(near)
        })
    }
}

/// The hit, and the steps (nodes visited, long leaves among them) and tests that it took in this order.
///
/// A tree whose status says that it cannot be used is traced as if it were empty, as the device must.
///
/// # Panics
/// The closest hit is asked for by [`Order::LeftFirst`].
pub fn trace<N: TracedNode>(tree: &Wide<N>, ray: &Ray, query: Query, order: Order) -> (Hit, Work) {
    assert!(order != Order::LeftFirst || query == Query::AnyHit, "left first is for rays that end at any hit");
    let mut walk = Walk { tree, query, nearest: Nearest::new(ray.t_max), work: Work::default() };
    let usable = tree.header.active != 0 && tree.header.status & status::UNUSABLE == 0;
    if let Some(ray) = PreparedRay::new(ray).filter(|_| usable) {
        match order {
            Order::Distance => walk.by_distance(&ray),
            Order::Octant => walk.by_octant(&ray),
            Order::LeftFirst => walk.left_first(&ray),
        }
    }
    (walk.nearest.hit_of(query), walk.work)
}

struct Walk<'a, N: TracedNode> {
    tree: &'a Wide<N>,
    query: Query,
    nearest: Nearest,
    work: Work,
}

/// Sorts four or eight: pairs that are brought in order, one after the other. The device sorts with these, and which of equal
/// ones comes first follows from them.
const NETWORK_OF_4: &[[usize; 2]] = &[[0, 1], [2, 3], [0, 2], [1, 3], [1, 2]];
const NETWORK_OF_8: &[[usize; 2]] = &[
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [1, 2],
    [5, 6],
    [0, 4],
    [3, 7],
    [1, 5],
    [2, 6],
    [1, 4],
    [3, 6],
    [2, 4],
    [3, 5],
    [3, 4],
];

impl<N: TracedNode> Walk<'_, N> {
    /// Tests the records of a leaf; whether the search is over.
    fn leaf(&mut self, ray: &PreparedRay, first: u32, count: u32) -> bool {
        self.work.leaves += 1;
        for triangle in self.tree.leaf(first, count) {
            self.work.tests += 1;
            self.nearest.consider(ray, triangle);
            if self.query == Query::AnyHit && self.nearest.hit.is_some() {
                return true;
            }
        }
        false
    }

    /// The nearest child first; the others wait with the distances at which the ray enters them.
    fn by_distance(&mut self, ray: &PreparedRay) {
        let network = if N::FORM.width() == 4 { NETWORK_OF_4 } else { NETWORK_OF_8 };
        let root = Child { index: 0, count: 0, ..self.tree.header.root };
        let mut waiting: Vec<(f32, Child)> = vec![(f32::NEG_INFINITY, root)];
        while let Some((entered, child)) = waiting.pop() {
            // Equally far is not too far: an equally near hit with a lower index may be there.
            if entered > self.nearest.t {
                continue;
            }
            if child.is_leaf() {
                if self.leaf(ray, child.index, child.count) {
                    return;
                }
                continue;
            }
            self.work.steps += 1;
            if let Some((first, count)) = self.tree.nodes[child.index as usize].long_leaf() {
                if self.leaf(ray, first, count) {
                    return;
                }
                continue;
            }
            let node = &self.tree.nodes[child.index as usize];
            let (enters, children) = (node.enters(ray, self.nearest.t), node.children());
            let mut entered: [_; 8] = std::array::from_fn(|slot| {
                let there = enters[slot].filter(|_| children[slot].is_some());
                (there.unwrap_or(f32::INFINITY), children[slot])
            });
            for &[a, b] in network {
                if entered[b].0 < entered[a].0 {
                    entered.swap(a, b);
                }
            }
            for (at, (distance, child)) in entered.into_iter().enumerate().rev() {
                if let Some(child) = child.filter(|_| distance < f32::INFINITY) {
                    // The nearest does not wait; of the others a long leaf is taken however far it is.
                    let waits = at > 0 && child.count < LONG_LEAF;
                    waiting.push((if waits { distance } else { f32::NEG_INFINITY }, child));
                }
            }
        }
    }

    /// The children in their slots, one after the other, each with all that is below it.
    fn left_first(&mut self, ray: &PreparedRay) {
        let mut waiting = vec![Child { index: 0, count: 0, ..self.tree.header.root }];
        while let Some(child) = waiting.pop() {
            if child.is_leaf() {
                if self.leaf(ray, child.index, child.count) {
                    return;
                }
                continue;
            }
            self.work.steps += 1;
            let node = &self.tree.nodes[child.index as usize];
            if let Some((first, count)) = node.long_leaf() {
                if self.leaf(ray, first, count) {
                    return;
                }
                continue;
            }
            let entered = node.enters(ray, self.nearest.t).into_iter().zip(node.children());
            let entered = entered.filter(|(enter, _)| enter.is_some_and(|enter| enter < f32::INFINITY));
            let children: Vec<Child> = entered.filter_map(|(_, child)| child).collect();
            waiting.extend(children.into_iter().rev());
        }
    }

    /// The leaves of a node first, then its nodes from near to far by the octant that the ray goes to; but the one that it enters first
    /// before the others, unless any hit ends it.
    fn by_octant(&mut self, ray: &PreparedRay) {
        let octant = (0..3).fold(0, |octant, i| octant | usize::from(ray.inverse[i].is_sign_negative()) << i);
        // Groups of nodes that wait, each with where the ray enters the nearest of them but the first that there was.
        let mut waiting = vec![(f32::NEG_INFINITY, vec![0])];
        while let Some((entered, mut group)) = waiting.pop() {
            // Equally far is not too far: an equally near hit with a lower index may be there.
            if entered > self.nearest.t {
                continue;
            }
            let index = group.pop().expect("groups that wait are not empty");
            if !group.is_empty() {
                waiting.push((entered, group));
            }
            self.work.steps += 1;
            let node = &self.tree.nodes[index as usize];
            if let Some((first, count)) = node.long_leaf() {
                if self.leaf(ray, first, count) {
                    return;
                }
                continue;
            }
            let (enters, children): (_, Slots) = (node.enters(ray, self.nearest.t), node.children());
            let in_order = (0..8).map(|place| place ^ octant);
            let entered: Vec<(f32, Child)> = in_order
                .filter_map(|slot| Some((enters[slot]?, children[slot]?)))
                .filter(|&(enter, _)| enter < f32::INFINITY)
                .collect();
            for (_, leaf) in entered.iter().filter(|(_, child)| child.is_leaf()) {
                if self.leaf(ray, leaf.index, leaf.count) {
                    return;
                }
            }
            let mut nodes: Vec<_> = entered.iter().filter(|(_, child)| !child.is_leaf()).collect();
            if self.query != Query::AnyHit {
                // Of those that are entered within eight floats of each other the one that comes first in the octant.
                let nearest = (0..nodes.len()).min_by_key(|&at| nodes[at].0.to_bits().cast_signed() & !7);
                if let Some(nearest) = nearest {
                    nodes[..=nearest].rotate_right(1);
                }
            }
            if let Some((first, others)) = nodes.split_first() {
                if !others.is_empty() {
                    let nearest = others.iter().fold(f32::INFINITY, |nearest, (enter, _)| nearest.min(*enter));
                    waiting.push((leading_half(nearest), others.iter().rev().map(|(_, child)| child.index).collect()));
                }
                waiting.push((f32::NEG_INFINITY, vec![first.1.index]));
            }
        }
    }
}

/// The leading half of a float that is not above `enter`: what an entry has room for.
fn leading_half(enter: f32) -> f32 {
    if enter >= 0.0 { f32::from_bits(enter.to_bits() & 0xFFFF_0000) } else { f32::NEG_INFINITY }
}
