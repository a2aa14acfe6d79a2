//! A ray made ready for the tests: shear, reciprocals and error bounds, computed once (glsl/trace/ray.glsl).

use super::Ray;
use crate::bvh::layout::Aabb;

/// Directions whose largest component lies outside these bounds hit nothing: their reciprocals would leave the floats.
const DIRECTION: std::ops::RangeInclusive<f32> = f32::from_bits((127 - 100) << 23)..=f32::from_bits((127 + 100) << 23);
/// A component of the direction less than this part of the largest is moved away from zero, so that no reciprocal is
/// infinite and no slab distance NaN. The ray moves by less than the slab's error bound, which covers it.
const FLATTEST: f32 = f32::from_bits((127 - 26) << 23);
/// 32 units of rounding, 2⁻²⁴ each: see [`super::slab`].
const SLAB_ERROR: f32 = f32::from_bits((127 - 19) << 23);
/// Covers the rounding of an origin moved by an error bound.
const ORIGIN_ERROR: f32 = f32::from_bits((127 - 22) << 23);

/// A ray with what both tests need of it.
#[derive(Debug, Clone, Copy)]
pub struct PreparedRay {
    /// Where it starts.
    pub origin: [f32; 3],
    /// A hit counts when `t_min < t < t_max`; a box, when the ray is in it anywhere from `t_min` to `t_max`.
    pub t_min: f32,
    /// See `t_min`.
    pub t_max: f32,
    /// The axis in which the direction is longest; x and y of the sheared space are the two that follow it.
    pub major: usize,
    /// Shear in x, shear in y, scale in z (Woop, Benthin, Wald 2013, section 3.1).
    pub shear: [f32; 3],
    /// The farthest that anything in the scene is from the origin along `major`.
    pub reach: f32,
    /// Reciprocal of the direction, finite.
    pub inverse: [f32; 3],
    /// The origin moved towards greater coordinates by the error bound: for distances to the least corner of a box.
    pub origin_lo: [f32; 3],
    /// The origin moved towards lesser coordinates: for distances to the greatest corner.
    pub origin_hi: [f32; 3],
}

impl PreparedRay {
    /// Prepares `ray` for a scene inside `bounds`; `None` if it can hit nothing (see [`Ray`]).
    pub fn new(ray: &Ray, bounds: &Aabb) -> Option<PreparedRay> {
        let d = ray.direction;
        let major = longest(d);
        let finite = ray.origin.iter().chain(&d).all(|x| x.is_finite());
        // Not `>=`: a NaN must not pass.
        if !(finite && DIRECTION.contains(&d[major].abs()) && ray.t_min <= ray.t_max) {
            return None;
        }
        let [x, y] = [(major + 1) % 3, (major + 2) % 3];
        let scale = 1.0 / d[major];
        let flattest = FLATTEST * d[major].abs();
        let extent: [f32; 3] =
            std::array::from_fn(|i| (bounds.lo[i] - ray.origin[i]).abs().max((bounds.hi[i] - ray.origin[i]).abs()));
        let reach = extent[major];
        let slack: [f32; 3] =
            std::array::from_fn(|i| SLAB_ERROR * (extent[i] + reach) + ORIGIN_ERROR * ray.origin[i].abs());
        Some(PreparedRay {
            origin: ray.origin,
            t_min: ray.t_min,
            t_max: ray.t_max,
            major,
            shear: [d[x] * scale, d[y] * scale, scale],
            reach,
            inverse: d.map(|d| 1.0 / if d.abs() < flattest { flattest.copysign(d) } else { d }),
            origin_lo: std::array::from_fn(|i| ray.origin[i] + slack[i]),
            origin_hi: std::array::from_fn(|i| ray.origin[i] - slack[i]),
        })
    }
}

fn longest(d: [f32; 3]) -> usize {
    let [x, y, z] = d.map(f32::abs);
    if z >= x && z >= y {
        2
    } else if y >= x {
        1
    } else {
        0
    }
}
