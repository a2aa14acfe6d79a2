//! Axis-aligned boxes.

use bytemuck::{Pod, Zeroable};

/// An axis-aligned box. Empty when `lo > hi`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Aabb {
    /// Least corner.
    pub lo: [f32; 3],
    /// Greatest corner.
    pub hi: [f32; 3],
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Aabb = Aabb { lo: [f32::INFINITY; 3], hi: [f32::NEG_INFINITY; 3] };

    /// The smallest box around `points`.
    pub fn around(points: &[[f32; 3]]) -> Aabb {
        points.iter().fold(Aabb::EMPTY, |b, &p| b.union(&Aabb { lo: p, hi: p }))
    }

    /// The smallest box around both.
    pub fn union(&self, other: &Aabb) -> Aabb {
        Aabb {
            lo: std::array::from_fn(|i| self.lo[i].min(other.lo[i])),
            hi: std::array::from_fn(|i| self.hi[i].max(other.hi[i])),
        }
    }

    /// Edge lengths.
    pub fn extent(&self) -> [f32; 3] {
        std::array::from_fn(|i| self.hi[i] - self.lo[i])
    }

    /// Half the surface area: xy + yz + zx. What SAH costs are made of; the factor two cancels.
    pub fn half_area(&self) -> f32 {
        let [x, y, z] = self.extent();
        x * y + y * z + z * x
    }

    /// The middle: (lo + hi) / 2, each half taken first so that huge boxes do not overflow.
    #[inline]
    pub fn centroid(&self) -> [f32; 3] {
        std::array::from_fn(|i| 0.5 * self.lo[i] + 0.5 * self.hi[i])
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f32 {
        let [x, y, z] = self.extent();
        (x * x + y * y + z * z).sqrt()
    }

    /// What both have in common; empty where that is nothing.
    pub fn intersection(&self, other: &Aabb) -> Aabb {
        Aabb {
            lo: std::array::from_fn(|i| self.lo[i].max(other.lo[i])),
            hi: std::array::from_fn(|i| self.hi[i].min(other.hi[i])),
        }
    }

    /// Whether `other` lies inside, touching allowed.
    pub fn contains(&self, other: &Aabb) -> bool {
        (0..3).all(|i| self.lo[i] <= other.lo[i] && other.hi[i] <= self.hi[i])
    }
}
