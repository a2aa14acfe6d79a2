//! The tracer on the host: the same traversal and arithmetic as `glsl/trace/`, and brute force.

use crate::bvh::layout::{Bvh2, Child, MAX_DEPTH, Triangle, status};
use crate::trace::ray::PreparedRay;
use crate::trace::triangle::meet;
use crate::trace::{Hit, Query, Ray, Work, slab};

/// From this many triangles on, the count of a waiting leaf is stored in place of its distance (`glsl/trace/stack.glsl`).
pub(super) const LONG_LEAF: u32 = 31;

/// The nearest hit; of equally near ones that with the lower primitive index.
pub fn closest_hit(tree: &Bvh2, ray: &Ray) -> Hit {
    trace(tree, ray, Query::ClosestHit).0
}

/// Any hit: `t` 0 and the primitive that was met first, or [`Hit::NONE`].
pub fn any_hit(tree: &Bvh2, ray: &Ray) -> Hit {
    trace(tree, ray, Query::AnyHit).0
}

/// The hit, and the steps and tests that it took.
///
/// A tree whose status says that it cannot be used is traced as if it were empty, as the device must.
pub fn trace(tree: &Bvh2, ray: &Ray, query: Query) -> (Hit, Work) {
    walk(tree, ray, query, FirstChild::Nearest)
}

/// Any hit, by the walk that takes the left child of each node first: for trees in an order of children
/// ([`crate::bvh::child_order`]).
pub fn trace_left_first(tree: &Bvh2, ray: &Ray) -> (Hit, Work) {
    walk(tree, ray, Query::AnyHit, FirstChild::Left)
}

/// Which child of a node a ray looks into first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FirstChild {
    Nearest,
    Left,
}

fn walk(tree: &Bvh2, ray: &Ray, query: Query, first: FirstChild) -> (Hit, Work) {
    let mut work = Work::default();
    let mut nearest = Nearest::new(ray.t_max);
    let usable = tree.header.active != 0 && tree.header.status & status::UNUSABLE == 0;
    let Some(ray) = PreparedRay::new(ray).filter(|_| usable) else {
        return (Hit::NONE, work);
    };
    // Children that wait, each with the distance at which the ray enters it. A long leaf is taken however far it is.
    let mut waiting: Vec<(f32, Child)> = Vec::with_capacity(MAX_DEPTH as usize);
    let mut next = Some(tree.header.root);
    while let Some(child) = next {
        next = None;
        if child.is_leaf() {
            work.leaves += 1;
            for triangle in &tree.records[child.index as usize..][..child.count as usize] {
                work.tests += 1;
                nearest.consider(&ray, triangle);
                if query == Query::AnyHit && nearest.hit.is_some() {
                    return (nearest.hit_of(query), work);
                }
            }
        } else {
            work.steps += 1;
            let [left, right] = tree.nodes[child.index as usize].children;
            let boxes = [left.bounds(), right.bounds()];
            match boxes.map(|b| slab::enter(&ray, &b, nearest.t)).into() {
                (Some(_), Some(_)) if first == FirstChild::Left => {
                    waiting.push((f32::NEG_INFINITY, right));
                    next = Some(left);
                }
                (Some(l), Some(r)) => {
                    let (near, far) = if r < l { (right, (l, left)) } else { (left, (r, right)) };
                    let entered = if far.1.count < LONG_LEAF { far.0 } else { f32::NEG_INFINITY };
                    waiting.push((entered, far.1));
                    next = Some(near);
                }
                (Some(_), None) => next = Some(left),
                (None, Some(_)) => next = Some(right),
                (None, None) => {}
            }
        }
        while next.is_none()
            && let Some((entered, child)) = waiting.pop()
        {
            // Equally far is not too far: an equally near hit with a lower index may be there.
            next = (entered <= nearest.t).then_some(child);
        }
    }
    (nearest.hit_of(query), work)
}

/// The primitives of all hits of a ray, each once, in ascending order.
pub fn all_hits(tree: &Bvh2, ray: &Ray) -> Vec<u32> {
    let usable = tree.header.active != 0 && tree.header.status & status::UNUSABLE == 0;
    let t_max = ray.t_max;
    let Some(ray) = PreparedRay::new(ray).filter(|_| usable) else { return Vec::new() };
    let mut hits = Vec::new();
    let mut waiting = vec![tree.header.root];
    while let Some(child) = waiting.pop() {
        if child.is_leaf() {
            let leaf = &tree.records[child.index as usize..][..child.count as usize];
            let is_met = |triangle: &&Triangle| {
                let mut nearest = Nearest::new(t_max);
                nearest.consider(&ray, triangle);
                nearest.hit.is_some()
            };
            hits.extend(leaf.iter().filter(is_met).map(|triangle| triangle.primitive));
        } else {
            let children = tree.nodes[child.index as usize].children;
            waiting.extend(children.into_iter().filter(|child| slab::enter(&ray, &child.bounds(), t_max).is_some()));
        }
    }
    hits.sort_unstable();
    hits.dedup();
    hits
}

/// The nearest hit by testing every triangle: what every tracer must find.
pub fn closest_hit_by_brute_force(tree: &Bvh2, ray: &Ray) -> Hit {
    brute_force(tree, ray).hit
}

/// Whether any triangle is hit, by testing every triangle. `t` is 0, the primitive that of the nearest hit.
pub fn any_hit_by_brute_force(tree: &Bvh2, ray: &Ray) -> Hit {
    brute_force(tree, ray).hit_of(Query::AnyHit)
}

fn brute_force(tree: &Bvh2, ray: &Ray) -> Nearest {
    let mut nearest = Nearest::new(ray.t_max);
    if let Some(ray) = PreparedRay::new(ray) {
        // Triangles that builders leave out stand behind the others.
        for triangle in &tree.records[..tree.header.active as usize] {
            nearest.consider(&ray, triangle);
        }
    }
    nearest
}

/// The best hit so far.
pub(super) struct Nearest {
    pub(super) t: f32,
    pub(super) hit: Hit,
}

impl Nearest {
    pub(super) fn new(t_max: f32) -> Nearest {
        Nearest { t: t_max, hit: Hit::NONE }
    }

    pub(super) fn consider(&mut self, ray: &PreparedRay, triangle: &Triangle) {
        if let Some(met) = meet(ray, triangle)
            && ray.t_min < met.t
            && met.t < ray.t_max
            && (met.t < self.t || met.t == self.t && triangle.primitive < self.hit.primitive)
        {
            self.t = met.t;
            self.hit = Hit { t: met.t, primitive: triangle.primitive, u: met.u, v: met.v };
        }
    }

    pub(super) fn hit_of(&self, query: Query) -> Hit {
        match query {
            Query::AnyHit if self.hit.is_some() => Hit { t: 0.0, ..self.hit },
            _ => self.hit,
        }
    }
}
