//! Frames along a path of a camera: the rays that teach, and those of the next frame.

use glam::Vec3;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::geometry::Aabb;
use hedgerow::trace::twin::tracer;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_lab::rays::kinds::{self, RayOptions};
use hedgerow_lab::rays::sample::FRAME;
use hedgerow_lab::scene::{Camera, Scene};
use rayon::prelude::*;

/// Rays, kind by kind.
pub type Frame = Vec<(Query, Vec<Ray>)>;

/// The camera `steps` frames later: each goes on by a hundredth of the diagonal and turns by three degrees.
pub fn later(camera: &Camera, bounds: &Aabb, steps: f32) -> Camera {
    let [eye, look, up] = [camera.eye, camera.look, camera.up].map(Vec3::from_array);
    let (forward, up) = ((look - eye).normalize(), up.normalize());
    let right = forward.cross(up).normalize();
    let eye = eye + 0.01 * steps * bounds.diagonal() * (0.8 * forward + 0.6 * right);
    let turned = glam::Quat::from_axis_angle(up, (3.0 * steps).to_radians()) * forward;
    Camera { eye: eye.to_array(), look: (eye + turned).to_array(), ..*camera }
}

/// Their closest hits.
pub fn closest(tree: &Bvh2, rays: &[Ray]) -> Vec<Hit> {
    rays.par_iter().map(|ray| tracer::closest_hit(tree, ray)).collect()
}

/// The rays of a frame.
pub fn rays_of(scene: &Scene, tree: &Bvh2, camera: Camera, size: [u32; 2], seed: u64) -> Frame {
    let scene = Scene { camera, ..scene.clone() };
    let of = |&kind| {
        let rays = kinds::generate(kind, &scene, &RayOptions { size, seed }, &mut |rays| Ok(closest(tree, rays)));
        (kind.query(), rays.expect("a scene with triangles"))
    };
    FRAME.iter().map(of).collect()
}

/// Steps and tests of all rays on the host: 3 a step and 2 a test.
pub fn work(tree: &Bvh2, frame: &Frame) -> f64 {
    let of_ray = |query: Query, ray: &Ray| {
        let work = tracer::trace(tree, ray, query).1;
        3 * u64::from(work.steps) + 2 * u64::from(work.tests)
    };
    frame.iter().map(|(query, rays)| rays.par_iter().map(|ray| of_ray(*query, ray)).sum::<u64>()).sum::<u64>() as f64
}
