//! The surface area heuristic: costs, and when a subtree is cheaper as a leaf.

use super::layout::Aabb;

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
    let magnitude = (0..3).map(|i| 0.5 * scene.hi[i] - 0.5 * scene.lo[i]).fold(0.0, f32::max);
    let exponent = (magnitude.to_bits() >> 23) as i32 & 0xFF;
    f32::from_bits(((127 + 127 - exponent).clamp(1, 254) as u32) << 23)
}

impl Aabb {
    /// [`Aabb::half_area`] of the box scaled by `scale`, in the order of operations that the device uses.
    pub fn scaled_half_area(&self, scale: f32) -> f32 {
        let [x, y, z]: [f32; 3] = std::array::from_fn(|i| self.hi[i] * scale - self.lo[i] * scale);
        x * y + y * z + z * x
    }
}
