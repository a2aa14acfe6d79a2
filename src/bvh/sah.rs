//! The surface area heuristic: costs, and when a subtree is cheaper as a leaf.

use crate::geometry::Aabb;

/// Whether and by which costs subtrees are collapsed into leaves (Meister and Bittner 2018, section 4; Frantál 2019, 3.6).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Collapse {
    /// Off: one triangle a leaf.
    pub enabled: bool,
    /// Cost of a traversal step.
    pub c_t: f32,
    /// Cost of a triangle test.
    pub c_i: f32,
}

impl Collapse {
    /// Collapse by SAH with c_T = 3, c_I = 2, the costs of the theses.
    pub const SAH: Collapse = Collapse { enabled: true, c_t: 3.0, c_i: 2.0 };
    /// The same for trees that become nodes of eight: a step of theirs takes the place of several binary ones, so one of those costs less. Rays
    /// are 1.03 times as fast as with the costs of the theses, and no faster with less (docs/notes/rays.md).
    pub const WIDE: Collapse = Collapse { c_t: 2.0, ..Collapse::SAH };
    /// One triangle a leaf.
    pub const OFF: Collapse = Collapse { enabled: false, ..Collapse::SAH };

    /// Cost of a leaf of `count` triangles with this area.
    pub fn leaf_cost(&self, area: f32, count: u32) -> f32 {
        self.c_i * area * count as f32
    }

    /// Cost of an inner node with this area over children of these costs.
    pub fn inner_cost(&self, area: f32, left: f32, right: f32) -> f32 {
        self.c_t * area + (left + right)
    }
}

/// The power of two by which lengths are scaled before areas are taken, so that scenes of 1e30 have finite areas and those of
/// 1e-30 have areas at all. Costs are compared only with each other: a common power of two changes nothing else.
pub fn area_scale(scene: &Aabb) -> f32 {
    area_scale_for(scene, scene)
}

/// The same where most of the scene is in a part of it, which is to have areas at all: its longest edge is 1 to 4 then, or that of the
/// whole is 2^40 to 2^42. The areas of 2^27 nodes of that length have a sum far below the largest float.
pub fn area_scale_for(scene: &Aabb, part: &Aabb) -> f32 {
    let exponent = |x: f32| (x.to_bits() >> 23) as i32 & 0xFF;
    let magnitude = |b: &Aabb| exponent((0..3).map(|i| 0.5 * b.hi[i] - 0.5 * b.lo[i]).fold(0.0, f32::max));
    let farthest = scene.lo.iter().chain(&scene.hi).fold(0.0, |m: f32, x| m.max(x.abs()));
    let scale = (254 - magnitude(part)).min(254 - magnitude(scene) + 40);
    // A scene of no extent that is far from the origin stays among the floats: its areas are 0, not NaN.
    f32::from_bits((scale.clamp(1, 254).min(3 * 127 - 1 - exponent(farthest)) as u32) << 23)
}

/// Edges shorter than this count as none, the scene's longest being 1 to 4. Areas are 2^-100 at least then, and differences of
/// areas 2^-123: among the subnormals, which some devices take for zero, costs would be compared otherwise than here.
pub(crate) const SHORTEST: f32 = 1.0 / (1u64 << 50) as f32;

impl Aabb {
    /// The edges of the box scaled by `scale`, in the order of operations that the device uses. Those of less than 2^-50 count as none.
    pub(crate) fn scaled_edges(&self, scale: f32) -> [f32; 3] {
        std::array::from_fn(|i| {
            let edge = self.hi[i] * scale - self.lo[i] * scale;
            if edge.abs() >= SHORTEST { edge } else { 0.0 }
        })
    }

    /// [`Aabb::half_area`] of the box scaled by `scale`. Edges of less than 2^-50 count as none.
    pub fn scaled_half_area(&self, scale: f32) -> f32 {
        half_area_of_edges(self.scaled_edges(scale))
    }
}

/// Half of the area of a box with these edges, in the order of operations that the device uses.
pub(crate) fn half_area_of_edges([x, y, z]: [f32; 3]) -> f32 {
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neither_areas_nor_their_differences_are_subnormal() {
        let edges = [0.0, 1e-30, 0.5 * SHORTEST, SHORTEST, SHORTEST * (1.0 + f32::EPSILON), 1e-7, 1.0];
        let boxes = edges.iter().flat_map(|&x| edges.map(|y| Aabb { lo: [0.0; 3], hi: [x, y, 1.5 * SHORTEST] }));
        let areas: Vec<f32> = boxes.map(|b| b.scaled_half_area(1.0)).collect();
        for a in &areas {
            assert!(areas.iter().all(|b| !(a - b).is_subnormal()), "{a}");
        }
        assert!(areas.contains(&0.0) && areas.iter().any(|&a| a > 0.0 && a < 1e-29));
    }

    #[test]
    fn a_part_has_areas_where_the_whole_is_huge_and_the_whole_stays_finite() {
        let part = Aabb { lo: [1.0; 3], hi: [2.0; 3] };
        for e in [10, 40, 60, 120] {
            let scene = Aabb { lo: [0.0; 3], hi: [2f32.powi(e); 3] };
            let scale = area_scale_for(&scene, &part);
            let (own, whole) = (part.scaled_half_area(scale), scene.scaled_half_area(scale));
            assert!(whole <= 48.0 * 2f32.powi(80) && own <= 48.0, "2^{e}: {own} {whole}");
            assert!(own >= 2f32.powi(-2 * (e - 40).max(0)).min(3.0) || e > 90, "2^{e}: {own}");
        }
        assert_eq!(area_scale_for(&part, &part), area_scale(&part));
    }

    #[test]
    fn areas_are_finite_wherever_the_scene_is_and_however_small() {
        let point = |at| Aabb { lo: [at; 3], hi: [at; 3] };
        for at in [0.0, 1e-30, -1.0, 1e30, -3e38] {
            let scene = point(at);
            assert_eq!(scene.scaled_half_area(area_scale(&scene)), 0.0, "{at}");
        }
        for (lo, hi) in [(1.0, 1.0 + f32::EPSILON), (1e30, 1.000_000_1e30), (-3e38, 3e38), (1e-37, 2e-37)] {
            let scene = Aabb { lo: [lo; 3], hi: [hi; 3] };
            let area = scene.scaled_half_area(area_scale(&scene));
            assert!((12.0..=192.0).contains(&area), "{lo} {hi}: {area}");
        }
    }
}
