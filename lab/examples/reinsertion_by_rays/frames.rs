//! Frames along a path of a camera: the rays that teach, those of the next frame, and what a tree costs them.

use glam::Vec3;
use hedgerow::bvh::layout::{Bvh2, Child};
use hedgerow::geometry::Aabb;
use hedgerow::trace::ray::PreparedRay;
use hedgerow::trace::triangle::meet;
use hedgerow::trace::twin::tracer;
use hedgerow::trace::{Hit, Query, Ray, slab};
use hedgerow_lab::rays::kinds::{self, RayOptions};
use hedgerow_lab::rays::sample::FRAME;
use hedgerow_lab::scene::{Camera, Scene};
use rayon::prelude::*;

/// The camera `steps` frames later: each goes on by a hundredth of the diagonal and turns by three degrees.
pub fn later(camera: &Camera, bounds: &Aabb, steps: f32) -> Camera {
    let [eye, look, up] = [camera.eye, camera.look, camera.up].map(Vec3::from_array);
    let (forward, up) = ((look - eye).normalize(), up.normalize());
    let right = forward.cross(up).normalize();
    let eye = eye + 0.01 * steps * bounds.diagonal() * (0.8 * forward + 0.6 * right);
    let turned = glam::Quat::from_axis_angle(up, (3.0 * steps).to_radians()) * forward;
    Camera { eye: eye.to_array(), look: (eye + turned).to_array(), ..*camera }
}

/// The rays of a frame, kind by kind.
pub fn rays_of(scene: &Scene, tree: &Bvh2, camera: Camera, size: [u32; 2], seed: u64) -> Vec<(Query, Vec<Ray>)> {
    let scene = Scene { camera, ..scene.clone() };
    let closest = |rays: &[Ray]| -> Vec<Hit> { rays.par_iter().map(|ray| tracer::closest_hit(tree, ray)).collect() };
    let of = |&kind| {
        let rays = kinds::generate(kind, &scene, &RayOptions { size, seed }, &mut |rays| Ok(closest(rays)));
        (kind.query(), rays.expect("a scene with triangles"))
    };
    FRAME.iter().map(of).collect()
}

/// Steps and tests of all rays: 3 a step and 2 a test, by kind.
pub fn work(tree: &Bvh2, frame: &[(Query, Vec<Ray>)]) -> Vec<f64> {
    let of_ray = |query: Query, ray: &Ray| {
        let work = tracer::trace(tree, ray, query).1;
        3 * u64::from(work.steps) + 2 * u64::from(work.tests)
    };
    frame.iter().map(|(query, rays)| rays.par_iter().map(|ray| of_ray(*query, ray)).sum::<u64>() as f64).collect()
}

/// Rays that teach.
pub struct Sample {
    pub rays: Vec<(Query, Ray)>,
}

impl Sample {
    pub fn new(frame: &[(Query, Vec<Ray>)], most: usize) -> Sample {
        let all: Vec<(Query, Ray)> =
            frame.iter().flat_map(|(query, rays)| rays.iter().map(move |ray| (*query, *ray))).collect();
        let stride = all.len().div_ceil(most).max(1);
        Sample { rays: all.into_iter().step_by(stride).collect() }
    }

    /// Of each link, the rays that go into it.
    pub fn entered(&self, tree: &Bvh2) -> Vec<u32> {
        let links = 2 * tree.nodes.len();
        let piece = self.rays.len().div_ceil(4).max(1);
        let counts = self.rays.par_chunks(piece).map(|rays| {
            let mut counts = vec![0u32; links];
            rays.iter().for_each(|(query, ray)| count(tree, ray, *query, &mut counts));
            counts
        });
        counts.reduce(
            || vec![0; links],
            |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                a
            },
        )
    }

    pub fn segments(&self, tree: &Bvh2) -> Vec<Segment> {
        self.rays.par_iter().map(|(_, ray)| Segment::new(ray, &tracer::closest_hit(tree, ray))).collect()
    }
}

/// `hedgerow::trace::twin::tracer` over a tree that is not finished, counting what it goes into.
fn count(tree: &Bvh2, ray: &Ray, query: Query, counts: &mut [u32]) {
    let Some(ray) = PreparedRay::new(ray) else { return };
    let mut nearest = ray.t_max;
    let mut waiting: Vec<(f32, u32, Child)> = Vec::new();
    let mut next = Some((u32::MAX, tree.header.root));
    while let Some((link, child)) = next.take() {
        if let Some(count) = counts.get_mut(link as usize) {
            *count += 1;
        }
        if child.is_leaf() {
            for triangle in &tree.records[child.index as usize..][..child.count as usize] {
                if let Some(met) = meet(&ray, triangle)
                    && ray.t_min < met.t
                    && met.t < nearest
                {
                    nearest = met.t;
                    if query == Query::AnyHit {
                        return;
                    }
                }
            }
        } else {
            let link = 2 * child.index;
            let [left, right] = tree.nodes[child.index as usize].children;
            match [left, right].map(|child| slab::enter(&ray, &child.bounds(), nearest)).into() {
                (Some(l), Some(r)) => {
                    let [near, far] = [(l, link, left), (r, link + 1, right)];
                    let (near, far) = if r < l { (far, near) } else { (near, far) };
                    waiting.push(far);
                    next = Some((near.1, near.2));
                }
                (Some(_), None) => next = Some((link, left)),
                (None, Some(_)) => next = Some((link + 1, right)),
                (None, None) => {}
            }
        }
        while next.is_none()
            && let Some((t, link, child)) = waiting.pop()
        {
            next = (t <= nearest).then_some((link, child));
        }
    }
}

/// A ray from its origin to where it ended.
#[derive(Clone, Copy)]
pub struct Segment {
    from: [f32; 3],
    direction: [f32; 3],
    inverse: [f32; 3],
    pub t_end: f32,
}

impl Segment {
    fn new(ray: &Ray, hit: &Hit) -> Segment {
        let t_end = if hit.is_some() { hit.t * (1.0 + 1e-6) } else { ray.t_max };
        let inverse = ray.direction.map(|d| 1.0 / if d.abs() < 1e-12 { 1e-12f32.copysign(d) } else { d });
        Segment { from: ray.origin, direction: ray.direction, inverse, t_end }
    }

    pub fn at(&self, t: f32) -> [f32; 3] {
        std::array::from_fn(|i| self.from[i] + t * self.direction[i])
    }

    /// The part of it in a box.
    #[inline(always)]
    pub fn within(&self, bounds: &Aabb) -> Option<[f32; 2]> {
        let (mut near, mut far) = (0.0f32, self.t_end);
        for i in 0..3 {
            let (a, b) =
                ((bounds.lo[i] - self.from[i]) * self.inverse[i], (bounds.hi[i] - self.from[i]) * self.inverse[i]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some([near, far])
    }

    #[inline(always)]
    pub fn meets(&self, bounds: &Aabb) -> bool {
        self.within(bounds).is_some()
    }
}
