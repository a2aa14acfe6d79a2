//! A ray made ready for the tests: shear, reciprocals and an error bound, computed once (glsl/trace/ray.glsl).

use super::Ray;

/// Directions whose largest component lies outside these bounds hit nothing: their reciprocals would leave the floats.
const DIRECTION: std::ops::RangeInclusive<f32> = f32::from_bits((127 - 100) << 23)..=f32::from_bits((127 + 100) << 23);
/// A component of the direction less than this part of the largest is moved away from zero, so that no reciprocal is
/// infinite and no slab distance NaN. The ray moves by ε/4 of its way, which is in the slab's error bound.
const FLATTEST: f32 = f32::from_bits((127 - 26) << 23);
/// By what part of the origin's coordinates every box is widened: 4ε.
const MARGIN: f32 = f32::from_bits((127 - 22) << 23);
/// By how much every box is widened at least: more than what a device flushes to zero, a few times 2⁻¹²⁶.
const LEAST_MARGIN: f32 = f32::from_bits((127 - 120) << 23);

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
    /// Reciprocal of the direction, finite.
    pub inverse: [f32; 3],
    /// By how much boxes are widened however near they are.
    pub margin: f32,
}

impl PreparedRay {
    /// `None` if the ray can hit nothing (see [`Ray`]).
    pub fn new(ray: &Ray) -> Option<PreparedRay> {
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
        let coordinate = ray.origin.iter().fold(0f32, |most, x| most.max(x.abs()));
        Some(PreparedRay {
            origin: ray.origin,
            t_min: ray.t_min,
            t_max: ray.t_max,
            major,
            shear: [d[x] * scale, d[y] * scale, scale],
            inverse: d.map(|d| 1.0 / if d.abs() < flattest { flattest.copysign(d) } else { d }),
            margin: MARGIN * coordinate + LEAST_MARGIN,
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
