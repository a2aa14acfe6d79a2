//! The box test that never hides a hit (glsl/trace/slab.glsl).
//!
//! Ize ("Robust BVH Ray Traversal", 2013) widens the slab distances by the rounding of the slab test itself. That is not
//! enough here: the triangle test rounds too, and what it takes for a hit may lie a little beside the ray. As Woop, Benthin
//! and Wald (2013, section 3.4) do, the boxes are seen widened by a bound on both. Theirs is computed once a ray, from the
//! scene's extent, so that one far triangle makes all boxes large. Here each box has its own: a part of *m*, the farthest that
//! a corner of it is from the origin along any axis. With ε = 2⁻²⁴, and the vertices of a triangle in the box no farther than m
//! along any axis either, the triangle's point with the computed weights and the point of the ray at the computed t differ
//!
//! - in the major axis by at most 18εm: the vertices' offsets ε, the barycentric weights' common factor 8ε (a device's
//!   reciprocal is good to 5ε), the weighted sum 3ε, the scale 6ε;
//! - in the others by that, by 2εm + 9εm from the shear (the offsets and what is left of them; the shear's factor, which a
//!   device's reciprocal has put off by 6ε, its product and the difference), and by 24εm from the cancellation in the edge
//!   functions, which the triangle test bounds ([`super::triangle`]).
//!
//! The slab distance adds at most 10εm: the corner's offset ε, its sum with the slack ε, the reciprocal 5ε and the product ε;
//! in a node whose corners are bytes 2ε more (`quantised_boxes.glsl`: the sum with the byte's part of the grid, and the
//! rounding of corners by the caller who chose the bytes). A direction that is moved away from zero ([`super::ray`]) adds εm/4.
//! All of it is less than 64εm = 2⁻¹⁸m ([`SLACK`]). Twice that is taken of the power of two below m: of two children that begin
//! in the same plane, the larger shall not seem nearer. What is off by a part of the coordinates themselves, as the corners
//! that come out of bytes are, is so by ε of the origin's at most and is in the margin. So for every box around the triangle
//! the interval that is computed here holds the computed t; it may be cut at the best t so far, and a box that is farther than
//! the best hit holds neither a nearer hit nor an equally near one. Where a triangle was split, its vertices may lie outside of
//! a part's box, by as much as it is long: so much larger a slack is in the box itself (`crate::bvh::twin::split`), and what is
//! said above is true of the box of whichever part has the point on the triangle; every point is in one.

use super::ray::PreparedRay;
use crate::bvh::layout::SLACK;
use crate::geometry::Aabb;

/// By how much boxes are widened whose corners are no farther from the origin along any axis; finite, that no box beyond the
/// floats' end makes it a NaN.
pub fn slack_of(ray: &PreparedRay, farthest: f32) -> f32 {
    const EXPONENT: u32 = 0x7f80_0000;
    let power_of_two = f32::from_bits(farthest.to_bits() & EXPONENT);
    (2.0 * SLACK * power_of_two + ray.margin).min(f32::MAX)
}

/// Where the ray enters the box, or `None` if it does not between `t_min` and `t_best`.
pub fn enter(ray: &PreparedRay, b: &Aabb, t_best: f32) -> Option<f32> {
    let mut farthest = f32::NEG_INFINITY;
    for i in 0..3 {
        farthest = farthest.max(ray.origin[i] - b.lo[i]).max(b.hi[i] - ray.origin[i]);
    }
    let slack = slack_of(ray, farthest);
    let (mut near, mut far) = (ray.t_min, t_best);
    for i in 0..3 {
        let lo = (ray.origin[i] - b.lo[i] + slack) * -ray.inverse[i];
        let hi = (b.hi[i] - ray.origin[i] + slack) * ray.inverse[i];
        near = near.max(lo.min(hi));
        far = far.min(lo.max(hi));
    }
    (near <= far).then_some(near)
}
