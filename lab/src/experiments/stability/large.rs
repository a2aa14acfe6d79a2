//! `stability large`: huge triangles at the edge of a scene (Riemersma 2024, section 3.3).
//!
//! Codes are normalised by bounds: by those of all boxes, which a huge triangle stretches as far as it reaches, or by narrower
//! ones, which leave the scene more bits. What they save depends on where the triangles stand: [`LargePlacement`].

use super::points::Experiment;
use super::relative::Stretch;
use crate::named::named;
use hedgerow::geometry::Aabb;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Where the huge triangles stand. Each is flat in one axis and 2^e times as long as the scene in the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LargePlacement {
    /// Upright at the positive end of x, their middles beside the scene's: its centroids stay where they were.
    Wall,
    /// The same at both ends of every axis.
    Walls,
    /// From the corner of greatest coordinates away from the scene, one in each plane: the centroids' bounds grow half as far.
    Outward,
}

named!(LargePlacement, "placement": Wall = "wall", Walls = "walls", Outward = "outward");

impl LargePlacement {
    /// What it is, for titles.
    pub fn what(self) -> &'static str {
        match self {
            LargePlacement::Wall => "a wall at one side",
            LargePlacement::Walls => "walls at all sides",
            LargePlacement::Outward => "triangles that reach away",
        }
    }
}

/// Huge triangles at the edge of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HugeTriangles {
    /// Where they stand.
    pub placement: LargePlacement,
    /// How many at each side or in each plane.
    pub count: u32,
}

/// From one triangle of a side to the next, in parts of the scene's extent.
const APART: f64 = 1e-3;

impl Stretch for HugeTriangles {
    const EXPERIMENT: Experiment = Experiment::Large;
    const WHAT: &'static str = "the huge triangles";

    fn beside(&self, bounds: &Aabb, e: u32) -> Option<Vec<[[f32; 3]; 3]>> {
        let [lo, hi] = [bounds.lo, bounds.hi].map(|corner| corner.map(f64::from));
        let extent: [f64; 3] = std::array::from_fn(|i| hi[i] - lo[i]);
        let times = f64::from(e).exp2();
        // In `axis` at a height of its own, in the others from `from` for 2^e extents.
        let flat = |axis: usize, height: f64, from: &dyn Fn(usize) -> f64| -> [[f32; 3]; 3] {
            let [x, y] = [(axis + 1) % 3, (axis + 2) % 3];
            [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0]].map(|[right, up]| {
                let mut corner = [0.0; 3];
                corner[axis] = height as f32;
                corner[x] = (from(x) + right * times * extent[x]) as f32;
                corner[y] = (from(y) + up * times * extent[y]) as f32;
                corner
            })
        };
        let around = |i: usize| 0.5 * (lo[i] + hi[i] - times * extent[i]);
        let mut all = Vec::new();
        for j in 0..self.count {
            let beside = APART * f64::from(j);
            for axis in 0..3 {
                let (above, below) = (hi[axis] + beside * extent[axis], lo[axis] - beside * extent[axis]);
                match self.placement {
                    LargePlacement::Wall if axis == 0 => all.push(flat(axis, above, &around)),
                    LargePlacement::Wall => {}
                    LargePlacement::Walls => all.extend([flat(axis, above, &around), flat(axis, below, &around)]),
                    LargePlacement::Outward => all.push(flat(axis, above, &|i| hi[i])),
                }
            }
        }
        all.iter().flatten().flatten().all(|x| x.is_finite()).then_some(all)
    }
}

impl fmt::Display for HugeTriangles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = if self.count == 1 { "one".into() } else { self.count.to_string() };
        write!(f, "{}, {count} each", self.placement.what())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hedgerow::bvh::codes::CodeBounds;

    const BOUNDS: Aabb = Aabb { lo: [0.0; 3], hi: [2.0, 4.0, 8.0] };

    /// The bounds that plain and concise codes are normalised by.
    fn bounds_of(placement: LargePlacement, count: u32, e: u32) -> [Aabb; 2] {
        let boxes: Vec<Aabb> = HugeTriangles { placement, count }
            .beside(&BOUNDS, e)
            .expect("finite")
            .iter()
            .map(|c| Aabb::around(c))
            .collect();
        let point = |p| Aabb { lo: p, hi: p };
        // The scene's own triangles are small: their boxes are hardly more than their centroids.
        let own = [BOUNDS.lo, BOUNDS.hi].map(point);
        let all = boxes.iter().chain(&own).fold(Aabb::EMPTY, |a, b| a.union(b));
        let centroids = boxes.iter().chain(&own).fold(Aabb::EMPTY, |a, b| a.union(&point(b.centroid())));
        [CodeBounds::Full, CodeBounds::Concise].map(|bounds| bounds.of(&all, &centroids))
    }

    #[test]
    fn a_wall_stretches_the_bounds_of_boxes_and_not_the_concise_ones() {
        let [full, concise] = bounds_of(LargePlacement::Wall, 1, 4);
        assert_eq!(full, Aabb { lo: [0.0, -30.0, -60.0], hi: [2.0, 34.0, 68.0] });
        assert_eq!(concise, BOUNDS);
    }

    #[test]
    fn walls_stretch_every_axis() {
        let [full, concise] = bounds_of(LargePlacement::Walls, 1, 4);
        assert_eq!(full, Aabb { lo: [-15.0, -30.0, -60.0], hi: [17.0, 34.0, 68.0] });
        assert_eq!(concise, BOUNDS);
        assert_eq!(
            HugeTriangles { placement: LargePlacement::Walls, count: 3 }.beside(&BOUNDS, 1).expect("finite").len(),
            18
        );
    }

    #[test]
    fn of_what_reaches_away_concise_bounds_can_cut_nothing() {
        let [full, concise] = bounds_of(LargePlacement::Outward, 1, 4);
        assert_eq!(full, Aabb { lo: [0.0; 3], hi: [34.0, 68.0, 136.0] });
        assert_eq!(concise, full);
    }

    #[test]
    fn what_floats_cannot_hold_is_left_out() {
        let huge = Aabb { lo: [-1e38; 3], hi: [1e38; 3] };
        let wall = HugeTriangles { placement: LargePlacement::Wall, count: 1 };
        assert!(wall.beside(&huge, 1).is_some());
        assert_eq!(wall.beside(&huge, 4), None);
        assert_eq!("walls".parse::<LargePlacement>().ok(), Some(LargePlacement::Walls));
        assert!("roof".parse::<LargePlacement>().is_err_and(|e| e.to_string().contains("wall, walls, outward")));
    }
}
