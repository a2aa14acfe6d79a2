//! The far triangle of the growth experiment (CONTRACT, "Records of experiments").

use super::points::Experiment;
use super::relative::Stretch;
use crate::named::named;
use hedgerow::geometry::Aabb;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Where the far triangle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// Behind the greatest corner.
    #[serde(rename = "+")]
    Positive,
    /// Before the least.
    #[serde(rename = "-")]
    Negative,
}

named!(Side, "side": Positive = "+", Negative = "-");

/// A far triangle that makes the bounds of a scene grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FarTriangle {
    /// In how many axes the bounds grow: 1 (x alone) or 3.
    pub axes: u32,
    /// Where the triangle is.
    pub side: Side,
}

/// In the axes that grow, the part of the grown extent that the triangle's box takes.
const DEPTH: f64 = 1e-6;
/// In the others, the part of the scene's.
const WIDTH: f64 = 1e-3;

impl FarTriangle {
    /// The triangle that makes `bounds` 2^`e` times as long; `None` where it has no place among the floats.
    fn triangle(&self, bounds: &Aabb, e: u32) -> Option<[[f32; 3]; 3]> {
        let times = f64::from(e).exp2();
        let edges: [[f64; 2]; 3] = std::array::from_fn(|i| {
            let (lo, hi) = (f64::from(bounds.lo[i]), f64::from(bounds.hi[i]));
            let extent = hi - lo;
            match self.side {
                _ if i >= self.axes as usize => [hi - extent * WIDTH, hi],
                Side::Positive => [lo + extent * times * (1.0 - DEPTH), lo + extent * times],
                Side::Negative => [hi - extent * times, hi - extent * times * (1.0 - DEPTH)],
            }
        });
        let [least, greatest]: [[f32; 3]; 2] = [0, 1].map(|end| edges.map(|edge| edge[end] as f32));
        let corners = [least, greatest, [greatest[0], least[1], greatest[2]]];
        corners.iter().flatten().all(|x| x.is_finite()).then_some(corners)
    }
}

impl FarTriangle {
    /// The box of the triangle.
    pub(super) fn bounds(&self, bounds: &Aabb, e: u32) -> Option<Aabb> {
        self.triangle(bounds, e).map(|corners| Aabb::around(&corners))
    }
}

impl Stretch for FarTriangle {
    const EXPERIMENT: Experiment = Experiment::Growth;
    const WHAT: &'static str = "the far triangle";

    fn beside(&self, bounds: &Aabb, e: u32) -> Option<Vec<[[f32; 3]; 3]>> {
        Some(vec![self.triangle(bounds, e)?])
    }
}

impl fmt::Display for FarTriangle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axes = if self.axes == 1 { "in one axis" } else { "in three axes" };
        let side = match self.side {
            Side::Positive => "to the positive side",
            Side::Negative => "to the negative side",
        };
        write!(f, "{axes} {side}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Aabb = Aabb { lo: [-1.0, 0.0, 2.0], hi: [1.0, 4.0, 3.0] };

    fn box_of(axes: u32, side: Side, e: u32) -> Aabb {
        FarTriangle { axes, side }.bounds(&BOUNDS, e).expect("finite")
    }

    #[test]
    fn the_bounds_grow_by_the_power_of_two_on_the_side_and_in_the_axes_asked_for() {
        let grown = |axes, side| BOUNDS.union(&box_of(axes, side, 10));
        assert_eq!(grown(1, Side::Positive), Aabb { lo: BOUNDS.lo, hi: [2047.0, 4.0, 3.0] });
        assert_eq!(grown(1, Side::Negative), Aabb { lo: [-2047.0, 0.0, 2.0], hi: BOUNDS.hi });
        assert_eq!(grown(3, Side::Positive), Aabb { lo: BOUNDS.lo, hi: [2047.0, 4096.0, 1026.0] });
        assert_eq!(grown(3, Side::Negative), Aabb { lo: [-2047.0, -4092.0, -1021.0], hi: BOUNDS.hi });
    }

    #[test]
    fn the_box_is_thin_where_the_bounds_grow_and_a_thousandth_wide_where_they_do_not() {
        let far = box_of(1, Side::Positive, 20);
        let depth = f64::from(far.hi[0]) - f64::from(far.lo[0]);
        assert!((depth / (2.0 * 20_f64.exp2() * 1e-6) - 1.0).abs() < 0.1, "{depth}");
        assert_eq!((far.lo[1], far.hi[1]), (3.996, 4.0));
        assert_eq!((far.lo[2], far.hi[2]), (2.999, 3.0));
    }

    #[test]
    fn at_zero_it_lies_in_the_scene() {
        for axes in [1, 3] {
            for side in Side::ALL {
                assert!(BOUNDS.contains(&box_of(axes, side, 0)));
            }
        }
    }

    #[test]
    fn what_floats_cannot_hold_is_no_triangle() {
        let huge = Aabb { lo: [0.0; 3], hi: [1e30; 3] };
        let triangle = |axes, side, e| FarTriangle { axes, side }.triangle(&huge, e);
        assert!(triangle(1, Side::Positive, 27).is_some());
        assert_eq!(triangle(1, Side::Positive, 29), None);
        assert_eq!(triangle(3, Side::Negative, 60), None);
    }
}
