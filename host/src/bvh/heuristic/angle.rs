//! The solid angle under which a point sees a box.

use std::f64::consts::PI;

/// Solid angles of this part of the whole sphere are those of flat rectangles: a difference of four arcs would keep few of their
/// digits.
const SMALL: f64 = 1e-9;

/// The solid angle, in steradians, under which the origin sees a rectangle at this distance, across the axis that it is `distance`
/// away along; `u` and `v` are its extents along the other two axes.
pub(super) fn of_rectangle([u0, u1]: [f64; 2], [v0, v1]: [f64; 2], distance: f64) -> f64 {
    let (u, v) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
    let squared = u * u + v * v + distance * distance;
    let flat = (u1 - u0) * (v1 - v0) * distance / (squared * squared.sqrt());
    let edge = (u1 - u0).max(v1 - v0);
    if flat < SMALL * 4.0 * PI && edge * edge < SMALL * squared {
        return flat;
    }
    let arc = |a: f64, b: f64| (a * b).atan2(distance * (a * a + b * b + distance * distance).sqrt());
    arc(u1, v1) - arc(u0, v1) - arc(u1, v0) + arc(u0, v0)
}

/// The part of all directions in which `from` sees the box: the faces that look at it side by side. 0 on the box and in it.
pub(super) fn of_box(from: [f64; 3], lo: [f64; 3], hi: [f64; 3]) -> f64 {
    let extent = |axis: usize| [lo[axis] - from[axis], hi[axis] - from[axis]];
    let of_face = |axis: usize| {
        let distance = (lo[axis] - from[axis]).max(from[axis] - hi[axis]);
        if distance <= 0.0 { 0.0 } else { of_rectangle(extent((axis + 1) % 3), extent((axis + 2) % 3), distance) }
    };
    (0..3).map(of_face).sum::<f64>() / (4.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_is_seen_under_a_sixth_of_the_sphere_through_each_face() {
        assert!((of_rectangle([-1.0, 1.0], [-1.0, 1.0], 1.0) - 4.0 * PI / 6.0).abs() < 1e-14);
        // Its corner touches a cube eight times as large: an eighth of the three faces around the opposite corner.
        let seen = of_box([0.0; 3], [1.0, 0.0, 0.0], [2.0, 1.0, 1.0]);
        assert!((seen - 1.0 / 24.0).abs() < 1e-14, "{seen}");
        assert_eq!(of_box([0.5; 3], [0.0; 3], [1.0; 3]), 0.0);
    }

    #[test]
    fn small_and_far_boxes_keep_their_digits() {
        for edge in [1e-3, 1e-4, 1e-5, 1e-6, 1e-8] {
            let seen = of_box([0.0; 3], [3.0, 4.0, 0.0], [3.0 + edge, 4.0 + edge, edge]);
            // Two faces, of area edge², each under the cosine 3/5 or 4/5 from 5 away.
            let expected = edge * edge * (0.6 + 0.8) / 25.0 / (4.0 * PI);
            assert!((seen / expected - 1.0).abs() < 2.0 * edge + 1e-6, "{edge}: {seen}, {expected}");
        }
    }
}
