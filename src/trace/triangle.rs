//! The watertight triangle test (Woop, Benthin, Wald 2013; glsl/trace/triangle.glsl): the definition of a hit.
//!
//! The triangle is moved and sheared so that the ray becomes the z axis; three 2×2 determinants then say on which side of
//! each edge the axis passes. Two triangles with a common edge compute the same two products for it, so no ray slips between
//! them as long as the sign is right. A difference of rounded products that is not zero has the sign of the exact one, as
//! rounding is monotone. Where it is zero, too small or too large to be trusted, [`super::determinant`] gives the exact sign
//! from integers, so that a device without doubles is as tight as the host, whatever the scale of the scene.
//!
//! The same path is taken where a hit is certain but the determinants cancel so much that the hit would be placed outside of
//! its own box. With M the largest sheared coordinate, an edge function is off by 4ε·M² (two products, their difference), the
//! weight made of it by 4ε·M²/|det| and its own rounding, and the place, the sum of three, by 12ε·M³/|det| + ε·M. [`super::slab`]
//! allows 24ε times the farthest that a vertex is from the origin along an axis. That is at least the greatest |z|, and at least
//! M/2, as a sheared coordinate is the sum of two; so hits are taken for accurate where 9/16·M³ ≤ max(|z|, M/2)·|det|, which
//! makes of the above 22ε·max(|z|, M/2) and 2ε·M/2.
//!
//! Between the two lies a step that settles all but what is on an edge or corner: the products as sums of two floats (Dekker
//! 1971; no fused operation, which devices round as they like), so that the errors above shrink by 2²⁰. Large thin triangles
//! need it at every hit, and integers take ten times its time.
//!
//! Every operation is written so that the device can do the same: no contraction, no reordering, and reciprocals that are correctly
//! rounded whatever the device makes of a division (`glsl/gpu/reciprocal.glsl`).

use super::determinant::{Scaled, difference_of_products};
use super::ray::PreparedRay;
use crate::bvh::layout::Triangle;

/// Edge functions of a smaller magnitude are not trusted: a device may flush the subnormal parts that they came from.
const TRUSTED: f32 = f32::from_bits((127 - 76) << 23);
/// Sheared coordinates whose cube is larger are not trusted: products of them come near the end of the floats.
const LARGEST_CUBE: f32 = f32::from_bits((127 + 100) << 23);

/// Where a ray's line meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meeting {
    /// Distance in units of the direction.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
}

/// The part of the largest sheared coordinate's cube that is compared with reach times determinant.
const PART_OF_CUBE: f32 = 0.5625;

/// Where the ray's line meets the triangle, at any t; edges and corners belong to it, triangles seen edge-on do not count.
#[inline]
pub fn meet(ray: &PreparedRay, triangle: &Triangle) -> Option<Meeting> {
    // Not by `map`, whose closures stay calls.
    let (a, b, c) = (sheared(ray, triangle.v0), sheared(ray, triangle.v1), sheared(ray, triangle.v2));
    let u = c.x * b.y - c.y * b.x;
    let v = a.x * c.y - a.y * c.x;
    let w = b.x * a.y - b.y * a.x;
    let least = u.min(v).min(w);
    let greatest = u.max(v).max(w);
    // Two edges that are surely passed on different sides: the common case.
    if least < -TRUSTED && greatest > TRUSTED {
        return None;
    }
    let m = [a.x, a.y, b.x, b.y, c.x, c.y].iter().fold(0f32, |m, x| m.max(x.abs()));
    let cube = m * m * m;
    // Along some axis, the farthest vertex is at least this far from the origin.
    let reach = [a.z, b.z, c.z].iter().fold(0.5 * m, |reach, z| reach.max(z.abs()));
    let trusted = least > TRUSTED || greatest < -TRUSTED;
    let accurate = cube < LARGEST_CUBE && PART_OF_CUBE * cube <= reach * (u + v + w).abs();
    let [u, v, w] = if trusted && accurate { [u, v, w] } else { carefully(a, b, c, m, reach)? };
    let scale = 1.0 / (u + v + w);
    let (u, v, w) = (u * scale, v * scale, w * scale);
    Some(Meeting { t: (u * a.z + v * b.z + w * c.z) * ray.shear[2], u: v, v: w })
}

/// A vertex in the space in which the ray is the z axis; z not yet scaled.
#[derive(Clone, Copy)]
struct Sheared {
    x: f32,
    y: f32,
    z: f32,
}

#[inline]
fn sheared(ray: &PreparedRay, vertex: [f32; 3]) -> Sheared {
    let from_origin = |axis: usize| vertex[axis] - ray.origin[axis];
    let (x, y, z) = (from_origin((ray.major + 1) % 3), from_origin((ray.major + 2) % 3), from_origin(ray.major));
    Sheared { x: x - ray.shear[0] * z, y: y - ray.shear[1] * z, z }
}

/// Whatever is larger than this part of the greatest product has the right sign when it comes out of [`difference`].
const CERTAIN: f32 = f32::from_bits((127 - 40) << 23);
/// What [`difference`] makes of the error of a plain difference of products.
const SMALLER: f32 = f32::from_bits((127 - 20) << 23);

/// The edge functions with right signs and accurate enough; `None` if the line misses. `m` is the largest sheared coordinate.
fn carefully(a: Sheared, b: Sheared, c: Sheared, m: f32, reach: f32) -> Option<[f32; 3]> {
    let edges @ [u, v, w] = [difference(c, b), difference(a, c), difference(b, a)];
    let (least, greatest) = (u.min(v).min(w), u.max(v).max(w));
    let nearest = u.abs().min(v.abs()).min(w.abs());
    let cube = m * m * m;
    let certain = nearest > CERTAIN * (m * m) && nearest > TRUSTED;
    if certain && least < 0.0 && greatest > 0.0 {
        return None;
    }
    let accurate = cube < LARGEST_CUBE && SMALLER * (PART_OF_CUBE * cube) <= reach * (u + v + w).abs();
    if certain && accurate { Some(edges) } else { exactly(a, b, c) }
}

/// p.x·q.y − p.y·q.x, the products as sums of two floats: off by less than 2⁻⁴⁴ of the greater product.
fn difference(p: Sheared, q: Sheared) -> f32 {
    let (first, second) = (product(p.x, q.y), product(p.y, q.x));
    let plain = first.0 - second.0;
    // What the subtraction lost (Knuth's TwoSum).
    let taken = plain - first.0;
    let lost = (first.0 - (plain - taken)) - (second.0 + taken);
    plain + (lost + (first.1 - second.1))
}

/// The rounded product, and what it is off by.
fn product(a: f32, b: f32) -> (f32, f32) {
    let rounded = a * b;
    let ([a, a_rest], [b, b_rest]) = (halves(a), halves(b));
    (rounded, ((a * b - rounded) + a * b_rest + a_rest * b) + a_rest * b_rest)
}

/// The leading 12 bits, and the rest.
fn halves(x: f32) -> [f32; 2] {
    let scaled = 4097.0 * x;
    let leading = scaled - (scaled - x);
    [leading, x - leading]
}

/// The edge functions with exact signs and 24 right bits, divided by a common power of two; `None` if the line misses.
fn exactly(a: Sheared, b: Sheared, c: Sheared) -> Option<[f32; 3]> {
    if ![a, b, c].iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
        return None;
    }
    let edge = |p: Sheared, q: Sheared| difference_of_products([p.x, q.y], [p.y, q.x]);
    let edges: [Scaled; 3] = [edge(c, b), edge(a, c), edge(b, a)];
    let passes = |sign: i32| edges.iter().any(|e| e.mantissa.signum() == sign);
    // On both sides, or on none: a triangle seen edge-on.
    if passes(1) == passes(-1) {
        return None;
    }
    let exponent = edges.iter().filter(|e| e.mantissa != 0).map(|e| e.exponent).max()?;
    Some(edges.map(|e| e.relative_to(exponent)))
}
