//! Tracing kd-trees on the host: with a full stack, by restarts, with push-down and with a short stack (Papay 2025, algorithms 1 to
//! 4, after Foley and Sugerman 2005 and Horn et al. 2007).
//!
//! All are one loop: a short stack holds the nearest of the cells that wait, and where it is empty and cells are left that it
//! had no room for, the way down begins again: at the root, or with push-down at the last node above which nothing waits. A
//! stack of unlimited capacity never restarts, one of none is kd-restart.
//!
//! **No hit is lost.** The thesis tells near, far and both by where the ray crosses the plane. But what the triangle test takes
//! for a hit may lie beside the ray, in another cell. With t the hit's computed distance, m the farthest that a vertex of the
//! triangle is from the origin along an axis, s the triangle's longest side: the triangle's point with the computed weights is
//! less than [`SLACK`]·m from the ray's point at t along each axis ([`crate::trace::slab`]). That point is within |t|·|d| of
//! the origin, d the direction's longest component, and so m ≤ (|t|·|d| + s)·(1 + 2⁻¹⁶). Every point of a triangle is in a cell
//! that references it; and of those few triangles that are longer than the header's `reach`, all that is within 2·SLACK·s of it
//! ([`crate::kdtree`], split clipping). So there is a point in a cell that references the triangle and is less than
//! SLACK·(|t|·|d| + reach)·(1 + 2⁻¹⁶) from the ray's point at t; and where it is left of a plane, or in it, the ray's point at
//! t is no farther right than that. Both children are visited by the part of the ray that is so near, at the end of its
//! interval that is farther from the origin: twice that, and twice the ray's margin, which is for the rounding of where the
//! planes are crossed (7ε of |t| and ε of the origin) and for a direction that is moved away from zero (ε/4 of |t|). Where the
//! ray runs in a plane, all of it visits both.
//!
//! **No cell is visited twice and none forgotten.** Intervals of cells overlap by this, so that t alone cannot tell, as in
//! kd-restart, where to go on. A bit a level does (Laine 2010, "Restart Trail for Stackless BVH Traversal"): 0 while a far
//! child waits, 1 where none does. When a cell is done, a one is added at the level of its parent; the carry finds the deepest
//! child that waits. What is visited and in which order depends on the ray and the planes alone, so each way down finds the
//! same.
//!
//! **A ray ends early** only when what it has hit is nearer than where it enters each of the cells that wait. Equally near is not
//! enough: a primitive with a lower index may be there.

use super::tracer::Nearest;
use crate::bvh::layout::{SLACK, status};
use crate::geometry::Aabb;
use crate::kdtree::layout::{Inner, KdContent, KdTree, MAX_DEPTH};
use crate::trace::kd::Traversal;
use crate::trace::ray::PreparedRay;
use crate::trace::{Hit, Query, Ray, Work};
use std::collections::VecDeque;

impl std::str::FromStr for Traversal {
    type Err = ();

    /// `stack`, `restart`, `push-down`, `short-N` or `short-N-push-down`, N being a capacity from 1 to [`MAX_DEPTH`].
    fn from_str(name: &str) -> std::result::Result<Traversal, ()> {
        let (capacity, push_down) = match name {
            "stack" => return Ok(Traversal::STACK),
            "restart" => return Ok(Traversal::RESTART),
            "push-down" => return Ok(Traversal::PUSH_DOWN),
            _ => {
                let short = name.strip_prefix("short-").ok_or(())?;
                short.strip_suffix("-push-down").map_or((short, false), |capacity| (capacity, true))
            }
        };
        let capacity = capacity.parse().ok().filter(|capacity| (1..=MAX_DEPTH as usize).contains(capacity)).ok_or(())?;
        Ok(Traversal { capacity, push_down })
    }
}

/// The nearest hit; of equally near ones that with the lower primitive index.
pub fn closest_hit(tree: &KdTree, ray: &Ray, traversal: Traversal) -> Hit {
    trace(tree, ray, Query::ClosestHit, traversal).0
}

/// Any hit: `t` 0 and the primitive that was met first, or [`Hit::NONE`].
pub fn any_hit(tree: &KdTree, ray: &Ray, traversal: Traversal) -> Hit {
    trace(tree, ray, Query::AnyHit, traversal).0
}

/// The hit, and the steps (inner nodes, each time that one is visited), tests and leaves that it took.
///
/// A tree whose status says that it cannot be used is traced as if it were empty.
pub fn trace(tree: &KdTree, ray: &Ray, query: Query, traversal: Traversal) -> (Hit, Work) {
    let mut work = Work::default();
    let mut nearest = Nearest::new(ray.t_max);
    let usable = !tree.nodes.is_empty() && tree.header.status & status::UNUSABLE == 0;
    let Some(prepared) = PreparedRay::new(ray).filter(|_| usable) else { return (Hit::NONE, work) };
    let line = Line {
        slack: 2.0 * SLACK * ray.direction[prepared.major].abs(),
        margin: 2.0 * (SLACK * tree.header.reach + prepared.margin),
        ray: prepared,
    };
    let Some((t_in, t_out)) = line.through(&tree.header.cell()) else { return (Hit::NONE, work) };

    let root = CellVisit { node: 0, level: 0, t_in, t_out, others: f32::INFINITY };
    let mut restart = root;
    let mut stack = VecDeque::with_capacity(traversal.capacity);
    let mut trail = Trail::default();
    let mut place = root;
    // Whether nothing waits above the place.
    let mut push_down = traversal.push_down;
    loop {
        // Down to a leaf, as long as the cell may hold a hit.
        while place.t_in <= nearest.t {
            let inner = match tree.nodes[place.node as usize].content() {
                KdContent::Inner(inner) => inner,
                KdContent::Leaf(range) => {
                    work.leaves += 1;
                    for &record in &tree.references[range] {
                        work.tests += 1;
                        nearest.consider(&line.ray, &tree.records[record as usize]);
                        if query == Query::AnyHit && nearest.hit.is_some() {
                            return (nearest.hit_of(query), work);
                        }
                    }
                    break;
                }
            };
            work.steps += 1;
            let near_is_done = trail.is_set(place.level);
            place = match line.children(&place, &inner) {
                [Some(near), Some(far)] if !near_is_done => {
                    push_down = false;
                    if stack.len() == traversal.capacity {
                        stack.pop_front();
                    }
                    if traversal.capacity > 0 {
                        stack.push_back(far);
                    }
                    CellVisit { others: place.others.min(far.t_in), ..near }
                }
                [near, far] => {
                    trail.set(place.level);
                    // Where both were to be visited, the near one has been.
                    match far.or(near) {
                        Some(child) => child,
                        None => break,
                    }
                }
            };
            if push_down {
                restart = place;
            }
        }
        if nearest.t < place.others || !trail.advance(place.level) {
            return (nearest.hit_of(query), work);
        }
        match stack.pop_back() {
            Some(next) => {
                place = next;
                push_down = false;
            }
            None => {
                place = restart;
                push_down = traversal.push_down;
            }
        }
    }
}

/// A node on the way, and the part of the ray that visits its cell.
#[derive(Debug, Clone, Copy)]
struct CellVisit {
    node: u32,
    level: u32,
    t_in: f32,
    t_out: f32,
    /// Where the ray enters the first of the cells that wait above.
    others: f32,
}

/// Of each level on the way down, from the highest bit on, whether no child waits there.
#[derive(Debug, Default)]
struct Trail(u64);

const _: () = assert!(MAX_DEPTH < u64::BITS);

impl Trail {
    fn bit(level: u32) -> u64 {
        1 << (u64::BITS - 1 - level)
    }

    fn is_set(&self, level: u32) -> bool {
        self.0 & Trail::bit(level) != 0
    }

    fn set(&mut self, level: u32) {
        self.0 |= Trail::bit(level);
    }

    /// A node at this level is done: on to the deepest child that waits above it. False if none does.
    fn advance(&mut self, level: u32) -> bool {
        let Some(parent) = level.checked_sub(1) else { return false };
        // Below, there may be the bit of a node from which no child was visited.
        let above = self.0 & !(Trail::bit(parent) - 1);
        let (next, is_done) = above.overflowing_add(Trail::bit(parent));
        self.0 = next;
        !is_done
    }
}

/// A ray, and by what part of t, and by how much besides, it may miss its triangle.
struct Line {
    ray: PreparedRay,
    slack: f32,
    margin: f32,
}

impl Line {
    /// The part of the ray whose hits may be in a cell.
    fn through(&self, cell: &Aabb) -> Option<(f32, f32)> {
        let ray = &self.ray;
        let lo: [f32; 3] = std::array::from_fn(|i| cell.lo[i] - ray.origin[i]);
        let hi: [f32; 3] = std::array::from_fn(|i| cell.hi[i] - ray.origin[i]);
        let farthest = lo.iter().chain(&hi).fold(0f32, |m, x| m.max(x.abs()));
        let slack = (2.0 * (SLACK * farthest + ray.margin)).min(f32::MAX);
        let lo: [f32; 3] = std::array::from_fn(|i| (lo[i] - slack) * ray.inverse[i]);
        let hi: [f32; 3] = std::array::from_fn(|i| (hi[i] + slack) * ray.inverse[i]);
        let t_in = (0..3).fold(ray.t_min, |t, i| t.max(lo[i].min(hi[i])));
        let t_out = (0..3).fold(ray.t_max, |t, i| t.min(lo[i].max(hi[i])));
        (t_in <= t_out).then_some((t_in, t_out))
    }

    /// The children that are visited, the near one first: those that are not empty and have a part of the ray.
    fn children(&self, place: &CellVisit, inner: &Inner) -> [Option<CellVisit>; 2] {
        let (axis, ray) = (inner.axis, &self.ray);
        let inverse = ray.inverse[axis];
        let farther = place.t_in.abs().max(place.t_out.abs());
        let slack = (self.slack * farther + self.margin).min(f32::MAX).copysign(inverse);
        let plane = inner.plane - ray.origin[axis];
        let [left, right] = inner.children;
        let (near, far) = if inverse > 0.0 { (left, right) } else { (right, left) };
        let t_out = place.t_out.min((plane + slack) * inverse);
        let t_in = place.t_in.max((plane - slack) * inverse);
        let visited = |node: Option<u32>, t_in: f32, t_out: f32| {
            node.filter(|_| t_in <= t_out).map(|node| CellVisit { node, level: place.level + 1, t_in, t_out, ..*place })
        };
        [visited(near, place.t_in, t_out), visited(far, t_in, place.t_out)]
    }
}
