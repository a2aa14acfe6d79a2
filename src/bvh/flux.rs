//! The flux of rays: how many of a sample meet a box, by a grid over the scene, whatever the box.
//!
//! The rays that meet a convex box are half of those that cross its faces, where each that begins or ends inside counts as one more
//! crossing. The grid counts both: at each of [`CELLS`]³ cells, the segments that cross its faces, and the ends in it. Summed from the
//! scene's corner, any box of whole cells takes eight points; within a cell the sums are linear.
//!
//! What is counted is whole numbers, so the grid is the same on every device, whatever the order of the rays.
//! [`crate::trace::flux`] fills it on the device and [`crate::trace::twin::flux`] on the host. [`super::reinsertion`] puts subtrees where few
//! rays go by it. `glsl/bvh/flux.glsl` has the same arithmetic.

use super::layout::{Bvh2, Record};
use crate::geometry::Aabb;

/// Cells along each axis.
pub const CELLS: u32 = 64;
/// Points along each axis.
pub(crate) const POINTS: u32 = CELLS + 1;
/// Places along a cell's edge.
pub(crate) const PARTS: u32 = 512;
/// Places along each axis.
pub(crate) const PLACES: f32 = (CELLS * PARTS) as f32;
/// Edges shorter than this have one cell, the scene's longest being 1 to 4.
const SHORTEST: f32 = 1.0 / (1u64 << 20) as f32;
/// Bytes of the head in front of the points.
pub(crate) const HEAD_BYTES: u64 = 32;

/// Bytes of a grid in memory, about 4.4 MB.
pub const GRID_BYTES: u64 = HEAD_BYTES + 16 * (POINTS * POINTS * POINTS) as u64;
/// The most rays that a grid holds: sums of more may have no room in 32 bits.
pub const MAX_FLUX_RAYS: u32 = (1 << 21) - 1;

/// The grid on the host.
#[derive(Debug, Clone, PartialEq)]
pub struct FluxGrid {
    pub(crate) lo: [f32; 3],
    pub(crate) scale: f32,
    pub(crate) factor: [f32; 3],
    /// Crossings of planes across x, y and z, and ends.
    pub(crate) points: Vec<[u32; 4]>,
}

impl FluxGrid {
    /// Without rays, over the box of a tree's root. That of a tree of nothing is one point.
    pub fn over<R: Record>(tree: &Bvh2<R>) -> FluxGrid {
        let header = &tree.header;
        let (bounds, scale) = match header.active {
            0 => (Aabb { lo: [0.0; 3], hi: [0.0; 3] }, 1.0),
            _ => (header.root.bounds(), header.area_scale),
        };
        let lo = bounds.lo.map(|x| x * scale);
        let factor = std::array::from_fn(|i| {
            let edge = bounds.hi[i] * scale - lo[i];
            if edge < SHORTEST { 0.0 } else { quotient(PLACES, edge) }
        });
        FluxGrid { lo, scale, factor, points: vec![[0; 4]; (POINTS * POINTS * POINTS) as usize] }
    }

    /// The bytes that it has on the device.
    pub fn to_bytes(&self) -> Vec<u8> {
        let FluxGrid { lo, scale, factor, points } = self;
        [
            bytemuck::bytes_of(lo),
            bytemuck::bytes_of(scale),
            bytemuck::bytes_of(factor),
            &[0; 4],
            bytemuck::cast_slice(points),
        ]
        .concat()
    }

    /// Where a point in space lies on the grid; what is beside it lies on its wall.
    fn place(&self, p: [f32; 3]) -> [u32; 3] {
        std::array::from_fn(|i| ((p[i] * self.scale - self.lo[i]) * self.factor[i]).clamp(0.0, PLACES) as u32)
    }

    /// How many segments meet a box: half of those that cross its faces and of the ends in it.
    pub fn rays(&self, bounds: &Aabb) -> f32 {
        let (lo, hi) = (self.place(bounds.lo), self.place(bounds.hi));
        let [x, y, z]: [Taps; 3] = std::array::from_fn(|i| Taps::of(lo[i], hi[i]));
        let mut sum = 0.0f32;
        for i in 0..x.count {
            // Across the faces along x; of all else, up to here.
            let (mut faces, mut others) = (0.0f32, 0.0f32);
            let mut before = [0u32; 4];
            for j in 0..y.count {
                let mut row = [0u32; 4];
                for k in 0..z.count {
                    let along = z.along[k];
                    let weights = [along, along, z.face[k], along];
                    let point = self.points[point([x.at[i], y.at[j], z.at[k]])];
                    row = std::array::from_fn(|c| row[c].wrapping_add(weights[c].wrapping_mul(point[c])));
                }
                others += y.face[j] as f32 * row[1] as f32;
                if j > 0 {
                    let between: [u32; 4] = std::array::from_fn(|c| row[c].wrapping_sub(before[c]));
                    faces += y.width[j] * between[0] as f32;
                    others += y.width[j] * (between[2] as f32 + between[3] as f32);
                }
                before = row;
            }
            sum += x.face[i] as f32 * faces + x.along[i] as i32 as f32 * others;
        }
        // 2⁹ parts along three axes, and half of it.
        sum.max(0.0) * (1.0 / (1u64 << 28) as f32)
    }
}

/// Where a point of the grid is kept.
pub(crate) fn point(at: [u32; 3]) -> usize {
    ((at[0] * POINTS + at[1]) * POINTS + at[2]) as usize
}

/// The cell of a place.
pub(crate) fn cell(place: u32) -> u32 {
    (place / PARTS).min(CELLS - 1)
}

/// The largest float whose product with `b`, rounded, is no more than `a`: the same on every device, whatever its division gives. For
/// positive numbers whose ratio is neither huge nor tiny.
pub(crate) fn quotient(a: f32, b: f32) -> f32 {
    // A division may be 2.5 units off, and the product half of one.
    let bits = (a / b).to_bits() + 8;
    let candidates = (0..24).map(|down| f32::from_bits(bits - down));
    candidates.into_iter().find(|q| q * b <= a).unwrap_or(f32::from_bits(bits - 24))
}

/// What a box takes of the points along an axis, two if it lies within a cell and four if not.
struct Taps {
    count: usize,
    at: [u32; 4],
    /// Both faces across the axis, each between two planes.
    face: [u32; 4],
    /// From the one face to the other: sums up to the far one less those up to the near one.
    along: [u32; 4],
    /// The same by what lies between a point and the one before.
    width: [f32; 4],
}

impl Taps {
    fn of(lo: u32, hi: u32) -> Taps {
        let (near, far) = (cell(lo), cell(hi));
        let (a, b) = (lo - PARTS * near, hi - PARTS * far);
        if near == far {
            return Taps {
                count: 2,
                at: [near, near + 1, 0, 0],
                face: [2 * PARTS - a - b, a + b, 0, 0],
                along: [a.wrapping_sub(b), b.wrapping_sub(a), 0, 0],
                width: [0.0, b.wrapping_sub(a) as f32, 0.0, 0.0],
            };
        }
        Taps {
            count: 4,
            at: [near, near + 1, far, far + 1],
            face: [PARTS - a, a, PARTS - b, b],
            along: [a.wrapping_sub(PARTS), 0u32.wrapping_sub(a), PARTS - b, b],
            width: [0.0, (PARTS - a) as f32, PARTS as f32, b as f32],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotient_is_the_largest_whose_product_is_not_above() {
        let mut word = 1u32;
        for _ in 0..100_000 {
            let mut next = || {
                word = word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f32::from_bits((word >> 9) | (127 - 20 + (word & 31)) << 23)
            };
            let (a, b) = (next(), next());
            let q = quotient(a, b);
            assert!(q * b <= a, "{a} / {b}");
            assert!(f32::from_bits(q.to_bits() + 1) * b > a, "{a} / {b}");
            // The same from wherever a device's division ends.
            assert!((q.to_bits() as i64 - (a / b).to_bits() as i64).abs() <= 2, "{a} / {b}");
        }
    }
}
