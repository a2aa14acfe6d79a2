//! What the table of costs is looked up by: how many triangles a scene has, and whether they crowd.

use crate::scene::Mesh;
use hedgerow::bvh::codes::{CodePlan, Codes};
use hedgerow::bvh::twin::geometry::finite_box;
use hedgerow::geometry::Aabb;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Triangles that share a code with one, in the mean, from which on a scene is crowded. A teapot in a stadium has thousands; scenes
/// that short codes suit have a few hundred at most.
const CROWD: f64 = 1000.0;

/// What is known of a scene before anything is built, by one pass over its triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneClass {
    /// Triangles.
    pub triangles: u64,
    /// Whether an LBVH's codes leave many triangles in one cell: a small object in a huge scene.
    pub is_crowded: bool,
}

impl SceneClass {
    /// The class of `mesh`.
    pub fn of(mesh: &Mesh) -> SceneClass {
        SceneClass { triangles: mesh.triangles.len() as u64, is_crowded: mean_crowd(mesh) > CROWD }
    }
}

/// How many triangles have the code that one has, in the mean over the triangles. Not a number where there are none.
fn mean_crowd(mesh: &Mesh) -> f64 {
    let count = mesh.triangles.len();
    let boxes: Vec<Result<Aabb, u32>> =
        (0..count).into_par_iter().map(|i| finite_box(&Aabb::around(&mesh.corners(i)))).collect();
    let plan = CodePlan::new(Codes::for_count(count as u32), &boxes);
    let mut codes: Vec<u64> = boxes.par_iter().flatten().map(|b| plan.encode(b)).collect();
    codes.par_sort_unstable();
    let squares: f64 = codes.chunk_by(|a, b| a == b).map(|crowd| (crowd.len() as f64).powi(2)).sum();
    squares / codes.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tiny triangles, this many at each place along a line.
    fn mesh(crowds: &[(f32, usize)]) -> Mesh {
        let at = |&(x, count): &(f32, usize)| vec![[[x, 0.0, 0.0], [x + 1e-6, 0.0, 0.0], [x, 1e-6, 0.0]]; count];
        let corners: Vec<[[f32; 3]; 3]> = crowds.iter().flat_map(at).collect();
        let triangles = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Mesh { positions: corners.as_flattened().to_vec(), triangles }
    }

    #[test]
    fn triangles_with_one_code_are_a_crowd() {
        // (600² + 2² + 1²) / 603.
        let mean = mean_crowd(&mesh(&[(0.0, 600), (0.5, 2), (1.0, 1)]));
        assert!((mean - 360_005.0 / 603.0).abs() < 1e-9, "{mean}");
    }

    #[test]
    fn one_large_crowd_makes_a_scene_crowded() {
        let class = |crowd| SceneClass::of(&mesh(&[(0.0, crowd), (0.5, 2), (1.0, 1)]));
        assert_eq!(class(900), SceneClass { triangles: 903, is_crowded: false });
        assert_eq!(class(1200), SceneClass { triangles: 1203, is_crowded: true });
    }

    #[test]
    fn a_scene_without_triangles_is_not_crowded() {
        assert_eq!(SceneClass::of(&mesh(&[])), SceneClass { triangles: 0, is_crowded: false });
    }
}
