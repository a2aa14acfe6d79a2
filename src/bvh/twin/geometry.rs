//! Reading the caller's triangles on the host, as `glsl/bvh/geometry.glsl` does on the device.

use crate::bvh::geometry::{IndexFormat, VertexFormat};
use crate::bvh::layout::{GeometryEntry, status};
use crate::geometry::Aabb;

/// [`Geometry`](crate::bvh::geometry::Geometry) in the host's memory.
#[derive(Debug, Clone, Copy)]
pub struct HostGeometry<'a> {
    /// The vertices' bytes.
    pub vertices: &'a [u8],
    /// Bytes from one vertex to the next.
    pub vertex_stride: u32,
    /// Vertices there are.
    pub vertex_count: u32,
    /// Their format.
    pub vertex_format: VertexFormat,
    /// The indices' bytes.
    pub indices: &'a [u8],
    /// Their format.
    pub index_format: IndexFormat,
    /// A matrix for every vertex, row by row.
    pub transform: Option<[[f32; 4]; 3]>,
    /// Triangles.
    pub primitive_count: u32,
}

/// The corners of a triangle, or the bit of [`status`] that says why it is left out.
pub type Corners = Result<[[f32; 3]; 3], u32>;

/// The flags of a structure's header, and its table, from the number of primitives and the flags of each geometry. There is a table
/// where there are several.
pub(crate) fn table_of(geometries: &[(u32, u32)]) -> (u32, Vec<GeometryEntry>) {
    let flags = || geometries.iter().map(|&(_, flags)| flags);
    let all = flags().reduce(|a, b| a & b).unwrap_or(0);
    let mut first = 0;
    let entries = geometries.iter().map(|&(count, flags)| {
        first += count;
        GeometryEntry { first: first - count, flags }
    });
    let table = if geometries.len() > 1 { entries.collect() } else { Vec::new() };
    (all | flags().fold(0, |a, b| a | b) << 8, table)
}

impl HostGeometry<'_> {
    /// All triangles in their order.
    pub fn corners(&self) -> impl Iterator<Item = Corners> {
        (0..self.primitive_count).map(|primitive| {
            let vertices = [0, 1, 2].map(|k| self.index(3 * primitive as usize + k));
            if vertices.iter().any(|&v| v >= self.vertex_count) {
                return Err(status::INDEX_OUT_OF_RANGE);
            }
            finite(vertices.map(|v| self.vertex(v)))
        })
    }

    fn index(&self, at: usize) -> u32 {
        let bytes = self.index_format.bytes() as usize;
        match self.index_format {
            IndexFormat::NONE => at as u32,
            _ => self.indices[at * bytes..][..bytes].iter().rev().fold(0, |index, &byte| index << 8 | u32::from(byte)),
        }
    }

    fn vertex(&self, index: u32) -> [f32; 3] {
        let bytes = &self.vertices[index as usize * self.vertex_stride as usize..];
        let format = self.vertex_format;
        let mut v = [0.0; 3];
        for (k, x) in v.iter_mut().enumerate().take(format.components() as usize) {
            *x = if format.component_bytes() == 4 {
                f32::from_le_bytes(bytes[4 * k..][..4].try_into().expect("four bytes"))
            } else {
                let word = u16::from_le_bytes(bytes[2 * k..][..2].try_into().expect("two bytes"));
                if format.is_half() { from_half(word) } else { from_snorm(word) }
            };
        }
        match self.transform {
            Some(rows) => rows.map(|[x, y, z, w]| x * v[0] + y * v[1] + z * v[2] + w),
            None => v,
        }
    }
}

/// Triangles that are not finite are left out. Adding zero turns −0 into 0: the least of two zeros is then the same on every
/// device.
pub(super) fn finite(corners: [[f32; 3]; 3]) -> Corners {
    if corners.iter().flatten().all(|x| x.is_finite()) {
        Ok(corners.map(|c| c.map(|x| x + 0.0)))
    } else {
        Err(status::NON_FINITE)
    }
}

/// Boxes that are not finite or hold nothing are left out.
#[doc(hidden)]
pub fn finite_box(b: &Aabb) -> Result<Aabb, u32> {
    let finite = b.lo.iter().chain(&b.hi).all(|x| x.is_finite()) && (0..3).all(|i| b.lo[i] <= b.hi[i]);
    finite.then(|| Aabb { lo: b.lo.map(|x| x + 0.0), hi: b.hi.map(|x| x + 0.0) }).ok_or(status::NON_FINITE)
}

fn from_half(bits: u16) -> f32 {
    let (sign, exponent, mantissa) = (u32::from(bits & 0x8000) << 16, bits >> 10 & 31, u32::from(bits & 1023));
    let magnitude = match exponent {
        0 => (mantissa as f32 * 2f32.powi(-24)).to_bits(),
        31 => 0x7f80_0000 | mantissa << 13,
        _ => (u32::from(exponent) + 112) << 23 | mantissa << 13,
    };
    f32::from_bits(sign | magnitude)
}

fn from_snorm(bits: u16) -> f32 {
    const UNIT: f32 = (1.0 / 32767.0f64) as f32;
    (f32::from(bits as i16) * UNIT).max(-1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_those_of_ieee_754() {
        // Values of the standard's binary16, from its definition.
        for (bits, value) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x3555, 0.333_251_95),
            (0x7bff, 65504.0),
            (0x0400, 2f32.powi(-14)),
            (0x03ff, 1023.0 / 1024.0 * 2f32.powi(-14)),
            (0x0001, 2f32.powi(-24)),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(from_half(bits), value, "{bits:#x}");
        }
        assert!(from_half(0x7e00).is_nan());
    }

    #[test]
    fn normalised_integers_reach_from_minus_one_to_one() {
        for (integer, value) in [(0, 0.0), (32767, 1.0), (-32767, -1.0), (-32768, -1.0), (16384, 0.500_015_26)] {
            assert!((from_snorm(integer as i16 as u16) - value).abs() <= f32::EPSILON, "{integer}");
        }
    }
}
