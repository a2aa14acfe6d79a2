//! The box test that never hides a hit (glsl/trace/slab.glsl).
//!
//! Ize ("Robust BVH Ray Traversal", 2013) widens the slab distances by the rounding of the slab test itself. That is not
//! enough here: the triangle test rounds too, and what it takes for a hit may lie a little beside the ray. As Woop, Benthin
//! and Wald (2013, section 3.4) do, the boxes are seen widened by a bound on both, computed once a ray. With ε = 2⁻²⁴, the
//! scene no farther than `extent` from the origin in each axis and `reach` in the major axis, a hit's triangle and the point
//! of the ray at its computed t differ
//!
//! - in the major axis by at most 18ε·reach: the vertices' offsets ε, the barycentric weights' common factor 8ε (a device's
//!   reciprocal is good to 5ε), the weighted sum 3ε, the scale 6ε;
//! - in the others by that, by 2ε·extent + 9ε·reach from the shear, and by 6ε·reach from the cancellation in the edge
//!   functions, which the triangle test bounds ([`super::triangle`]).
//!
//! The slab distance itself adds 7ε·extent. All of it is less than 32ε·(extent + reach), [`super::ray`]'s bound. So for every
//! box around the triangle the interval that is computed here holds the computed t; it may be cut at the best t so far, and a
//! box that is farther than the best hit holds neither a nearer hit nor an equally near one. Where a triangle was split, that is
//! true of the box of whichever part has the point on the triangle; every point is in one (`crate::bvh::host::split`).

use super::ray::PreparedRay;
use crate::bvh::layout::Child;

/// Where the ray enters the child's box, or `None` if it does not between `t_min` and `t_best`.
pub fn enter(ray: &PreparedRay, child: &Child, t_best: f32) -> Option<f32> {
    let lo: [f32; 3] = std::array::from_fn(|i| (child.lo[i] - ray.origin_lo[i]) * ray.inverse[i]);
    let hi: [f32; 3] = std::array::from_fn(|i| (child.hi[i] - ray.origin_hi[i]) * ray.inverse[i]);
    let near = (0..3).fold(ray.t_min, |t, i| t.max(lo[i].min(hi[i])));
    let far = (0..3).fold(t_best, |t, i| t.min(lo[i].max(hi[i])));
    (near <= far).then_some(near)
}
