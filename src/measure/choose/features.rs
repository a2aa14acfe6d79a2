//! What is known of a scene before anything is built: one pass over the boxes of its triangles, and what reinsertion gains on a
//! sample of them.

use super::sample;
use crate::bvh::layout::Aabb;
use crate::scene::Mesh;
use serde::{Deserialize, Serialize};

/// How many figures describe a scene.
pub const COUNT: usize = 5;

/// As many octaves below the scene's diagonal a triangle may be: the bits of a float.
const FINEST: f64 = 24.0;

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
    // How much the scene's diagonal over that of a triangle's box is beyond 10 octaves, the bits of an axis in a 30-bit code, in the
    // mean: what such a code cannot tell apart.
    "blur",
    // Area of the boxes of all triangles over that of the triangles on both sides: how empty boxes are.
    "hollowness",
    // Area of the boxes of all triangles over that of the scene's: how many of them a random ray meets.
    "crossing",
    // Cost of the LBVH after reinsertion over that before, on a sample of the boxes: how much a better tree gains.
    "reinsertion",
];

impl Features {
    /// The figures of `mesh`. Of one without extent, those that are not numbers are 0.
    pub fn of(mesh: &Mesh) -> Features {
        let count = mesh.triangles.len();
        let mut bounds = Aabb::EMPTY;
        let (mut crossed, mut surface) = (0.0, 0.0);
        let (mut boxes, mut sizes): (Vec<Aabb>, Vec<f64>) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for i in 0..count {
            let corners = mesh.corners(i);
            let around = Aabb::around(&corners);
            bounds = bounds.union(&around);
            boxes.push(around);
            sizes.push(diagonal(&around).log2());
            crossed += half_area(&around);
            surface += area(&corners);
        }
        // In octaves; triangles without extent are as fine as floats tell apart.
        let scene = diagonal(&bounds).log2();
        let octaves = sizes.iter().map(|size| (scene - size).min(FINEST));
        let blur = octaves.map(|o| (o - 10.0).max(0.0)).sum::<f64>() / count as f64;
        let values = [
            (count as f64).log2(),
            blur,
            (crossed / surface).log2(),
            (crossed / half_area(&bounds)).log2(),
            sample::gain(&boxes),
        ];
        let number = |value: f64| if value.is_finite() { value } else { 0.0 };
        Features { triangles: count as u64, values: values.map(number) }
    }
}

fn extent(b: &Aabb) -> [f64; 3] {
    std::array::from_fn(|i| f64::from(b.hi[i]) - f64::from(b.lo[i]))
}

fn diagonal(b: &Aabb) -> f64 {
    extent(b).iter().map(|e| e * e).sum::<f64>().sqrt()
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
        // The scene is 9 × 8. Of two boxes there is one tree.
        let expected: [f64; COUNT] = [1.0, 0.0, (60.0f64 / 30.0).log2(), (60.0f64 / 72.0).log2(), 0.0];
        assert_eq!(triangles, 2);
        for ((name, value), expected) in NAMES.iter().zip(values).zip(expected) {
            assert!((value - expected).abs() < 1e-12, "{name}: {value}, {expected}");
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
