//! What is known of a scene before anything is built: one pass over the boxes of its triangles.

use crate::bvh::codes::code_bounds;
use crate::bvh::layout::Aabb;
use crate::scene::Mesh;
use serde::{Deserialize, Serialize};

/// How many figures describe a scene.
pub const COUNT: usize = 6;

/// The figures of a scene. All are logarithms to base 2: models of ratios are sums.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Features {
    /// Triangles.
    pub triangles: u64,
    /// In the order of [`NAMES`].
    pub values: [f64; COUNT],
}

/// What the figures say.
pub const NAMES: [&str; COUNT] = [
    // Triangles.
    "count",
    // Diagonal of the scene over the mean diagonal of a triangle's box.
    "fineness",
    // Root of the mean square of these diagonals over their mean: 0 where all are alike.
    "mixture",
    // Area of the full bounds over that of the concise ones (Riemersma 2024, equation 15).
    "fringe",
    // Area of the boxes of all triangles over that of the triangles on both sides: how empty boxes are.
    "hollowness",
    // Area of the boxes of all triangles over that of the scene's: how many of them a random ray meets.
    "crossing",
];

impl Features {
    /// The figures of `mesh`. Of one without extent, those that are not numbers are 0.
    pub fn of(mesh: &Mesh) -> Features {
        let count = mesh.triangles.len();
        let (mut bounds, mut centroids) = (Aabb::EMPTY, Aabb::EMPTY);
        let (mut diagonals, mut squares, mut boxes, mut surface) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..count {
            let corners = mesh.corners(i);
            let around = Aabb::around(&corners);
            let centroid = around.centroid();
            bounds = bounds.union(&around);
            centroids = centroids.union(&Aabb { lo: centroid, hi: centroid });
            let square: f64 = extent(&around).iter().map(|e| e * e).sum();
            diagonals += square.sqrt();
            squares += square;
            boxes += half_area(&around);
            surface += area(&corners);
        }
        let of_count = count as f64;
        let diagonal = extent(&bounds).iter().map(|e| e * e).sum::<f64>().sqrt();
        let concise = half_area(&code_bounds(&bounds, &centroids, true));
        let ratios = [
            of_count,
            diagonal * of_count / diagonals,
            (squares * of_count).sqrt() / diagonals,
            half_area(&bounds) / concise,
            boxes / surface,
            boxes / half_area(&bounds),
        ];
        let log = |ratio: f64| if ratio > 0.0 && ratio.is_finite() { ratio.log2() } else { 0.0 };
        Features { triangles: count as u64, values: ratios.map(log) }
    }
}

fn extent(b: &Aabb) -> [f64; 3] {
    std::array::from_fn(|i| f64::from(b.hi[i]) - f64::from(b.lo[i]))
}

fn half_area(b: &Aabb) -> f64 {
    let [x, y, z] = extent(b);
    x * y + y * z + z * x
}

fn area(corners: &[[f32; 3]; 3]) -> f64 {
    let [v0, v1, v2] = corners.map(|v| glam::Vec3::from(v).as_dvec3());
    0.5 * (v1 - v0).cross(v2 - v0).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(corners: &[[[f32; 3]; 3]]) -> Mesh {
        let count = corners.len() as u32;
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Mesh { positions: corners.as_flattened().to_vec(), triangles }
    }

    #[test]
    fn figures_of_two_triangles_by_hand() {
        // Boxes of 3 × 4 and 6 × 8, side by side in a plane: diagonals 5 and 10, half areas 12 and 48, half of each is surface.
        let a = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        let b = [[3.0, 0.0, 0.0], [9.0, 0.0, 0.0], [3.0, 8.0, 0.0]];
        let Features { triangles, values } = Features::of(&mesh(&[a, b]));
        // The scene is 9 × 8; centroids lie from (1.5, 2) to (6, 4): concise bounds cut 1.5 and 2 from either side.
        let concise: f64 = (9.0 - 3.0) * (8.0 - 4.0);
        let expected: [f64; COUNT] =
            [2.0, 145f64.sqrt() / 7.5, 62.5f64.sqrt() / 7.5, 72.0 / concise, 60.0 / 30.0, 60.0 / 72.0];
        assert_eq!(triangles, 2);
        for ((name, value), expected) in NAMES.iter().zip(values).zip(expected) {
            assert!((value - expected.log2()).abs() < 1e-12, "{name}: {value}, {}", expected.log2());
        }
    }

    #[test]
    fn scenes_without_extent_have_numbers() {
        for corners in [vec![], vec![[[1.0; 3]; 3]; 4]] {
            let features = Features::of(&mesh(&corners));
            assert!(features.values.iter().all(|v| v.is_finite()), "{features:?}");
        }
    }
}
