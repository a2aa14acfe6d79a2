//! What is known of a scene before anything is built: one pass over the boxes of its triangles, and what reinsertion gains on a
//! sample of them.

use super::sample;
use crate::scene::Mesh;
use hedgerow::bvh::codes::{Codes, Plan};
use hedgerow::bvh::twin::geometry::finite_box;
use hedgerow::geometry::Aabb;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How many figures describe a scene.
pub const COUNT: usize = 5;

/// A crowd of so many triangles costs nothing that is seen: its order in the file is one in space, too.
const SMALL_CROWD: f64 = 128.0;

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
    // How many triangles have the code that one has, in the mean, over SMALL_CROWD: what an LBVH's codes cannot tell apart. The mean of
    // logarithms would tell less: a fifth of the triangles in one crowd costs more than all in crowds of thirty.
    "crowding",
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
        let mut boxes: Vec<Aabb> = Vec::with_capacity(count);
        for i in 0..count {
            let corners = mesh.corners(i);
            let around = Aabb::around(&corners);
            bounds = bounds.union(&around);
            boxes.push(around);
            crossed += half_area(&around);
            surface += area(&corners);
        }
        let values = [
            (count as f64).log2(),
            crowding(&boxes),
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

/// log2 of the mean of how many boxes have the code of one, over a small crowd; 0 where it is less.
fn crowding(boxes: &[Aabb]) -> f64 {
    let finite: Vec<Result<Aabb, u32>> = boxes.iter().map(finite_box).collect();
    let plan = Plan::new(Codes::for_count(boxes.len() as u32), &finite);
    let mut codes: Vec<u64> = finite.par_iter().flatten().map(|b| plan.encode(b)).collect();
    codes.par_sort_unstable();
    let crowds = codes.chunk_by(|a, b| a == b).map(|crowd| crowd.len() as f64);
    let mean = crowds.map(|size| size * size).sum::<f64>() / codes.len() as f64;
    (mean / SMALL_CROWD).max(1.0).log2()
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
        // The scene is 9 × 8. Codes tell the two apart, and of two boxes there is one tree.
        let expected: [f64; COUNT] = [1.0, 0.0, (60.0f64 / 30.0).log2(), (60.0f64 / 72.0).log2(), 0.0];
        assert_eq!(triangles, 2);
        for ((name, value), expected) in NAMES.iter().zip(values).zip(expected) {
            assert!((value - expected).abs() < 1e-12, "{name}: {value}, {expected}");
        }
    }

    #[test]
    fn what_has_the_same_code_is_a_crowd() {
        // Some at one place, two at another, one far away.
        let at = |x: f32| [[x, 0.0, 0.0], [x + 1e-6, 0.0, 0.0], [x, 1e-6, 0.0]];
        let crowding = |some: usize| {
            let crowds = [vec![at(0.0); some], vec![at(0.5); 2], vec![at(1.0)]].concat();
            Features::of(&mesh(&crowds)).values[1]
        };
        assert_eq!(crowding(100), 0.0);
        let expected = ((600.0 * 600.0 + 2.0 * 2.0 + 1.0) / 603.0 / 128.0f64).log2();
        assert!((crowding(600) - expected).abs() < 1e-12, "{} {expected}", crowding(600));
    }

    #[test]
    fn scenes_without_extent_have_numbers() {
        for corners in [vec![], vec![[[1.0; 3]; 3]; 4]] {
            let features = Features::of(&mesh(&corners));
            assert!(features.values.iter().all(|v| v.is_finite()), "{features:?}");
        }
    }
}
