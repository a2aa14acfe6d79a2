//! Triangles in every format, in the host's memory and on the device.

use super::device;
use super::shapes::Corners;
use hedgerow::bvh::geometry::{Geometry, GeometryFlags, IndexFormat, VertexFormat};
use hedgerow::bvh::twin::geometry::HostGeometry;
use hedgerow_lab::device::Buffer;
use hedgerow_lab::random::SplitMix64;

/// A matrix that turns, shears, mirrors and moves.
pub const MOVED: [[f32; 4]; 3] = [[0.5, -2.0, 0.25, 10.0], [1.0, 0.75, 0.0, -0.3], [0.0, 0.1, -3.0, 1e-3]];

/// The half of a multiple of 1/8 below 8 in magnitude, from the definition of binary16: exact.
pub fn half(x: f32) -> u16 {
    let bits = x.to_bits();
    let sign = (bits >> 16 & 0x8000) as u16;
    if x == 0.0 { sign } else { sign | (((bits >> 23 & 255) - 112) << 10 | bits >> 13 & 1023) as u16 }
}

/// A geometry in the host's memory.
#[derive(Clone)]
pub struct Owned {
    pub vertices: Vec<u8>,
    pub vertex_stride: u32,
    pub vertex_count: u32,
    pub vertex_format: VertexFormat,
    pub indices: Vec<u8>,
    pub index_format: IndexFormat,
    pub transform: Option<[[f32; 4]; 3]>,
    pub primitive_count: u32,
}

impl Owned {
    /// `count` triangles whose vertices are random bits of the format, `padding` bytes apart.
    pub fn random(
        vertex_format: VertexFormat,
        index_format: IndexFormat,
        padding: u32,
        count: u32,
        seed: u64,
    ) -> Owned {
        let mut random = SplitMix64::new(seed);
        let bytes = vertex_format.component_bytes();
        let vertex_stride = bytes * vertex_format.components() + padding;
        let vertex_count = if index_format == IndexFormat::NONE { 3 * count } else { 200 };
        let mut vertices = vec![0xa5; (vertex_stride * vertex_count) as usize];
        for vertex in vertices.chunks_exact_mut(vertex_stride as usize) {
            for component in vertex.chunks_exact_mut(bytes as usize).take(vertex_format.components() as usize) {
                match component.len() {
                    4 => component.copy_from_slice(&random.signed().to_le_bytes()),
                    // Every pattern: halves that are subnormal, infinite or not numbers, too.
                    _ => component.copy_from_slice(&(random.bits() as u16).to_le_bytes()),
                }
            }
        }
        let mut indices = Vec::new();
        for _ in 0..3 * count {
            // Some name vertices that are not there.
            let index = random.bits() % 203;
            indices.extend_from_slice(&index.to_le_bytes()[..index_format.bytes() as usize]);
        }
        let transform = None;
        Owned {
            vertices,
            vertex_stride,
            vertex_count,
            vertex_format,
            indices,
            index_format,
            transform,
            primitive_count: count,
        }
    }

    pub fn view(&self) -> HostGeometry<'_> {
        HostGeometry {
            vertices: &self.vertices,
            vertex_stride: self.vertex_stride,
            vertex_count: self.vertex_count,
            vertex_format: self.vertex_format,
            indices: &self.indices,
            index_format: self.index_format,
            transform: self.transform,
            primitive_count: self.primitive_count,
        }
    }

    /// Brings it to the device, its vertices and indices `shift` of their own sizes behind the buffers' beginnings.
    pub fn upload(&self, first: u32, shift: usize) -> (Geometry, [Buffer<'static>; 3]) {
        let shifted = |bytes: &[u8], by: u32| {
            let by = shift * by as usize;
            let all: Vec<u8> = std::iter::repeat_n(0x5a, by).chain(bytes.iter().copied()).chain([0; 4]).collect();
            let buffer = device().upload("geometry", &all).expect("memory");
            let address = buffer.address() + by as u64;
            (buffer, address)
        };
        let (vertices, vertex_address) = shifted(&self.vertices, self.vertex_format.component_bytes());
        let (indices, index_address) = shifted(&self.indices, self.index_format.bytes());
        let matrix = device().upload("transform", &[self.transform.unwrap_or_default()]).expect("memory");
        let geometry = Geometry {
            flags: GeometryFlags::NONE,
            vertices: vertex_address,
            indices: index_address,
            transform: if self.transform.is_some() { matrix.address() } else { 0 },
            vertex_stride: self.vertex_stride,
            vertex_count: self.vertex_count,
            vertex_format: self.vertex_format,
            index_format: self.index_format,
            first,
        };
        (geometry, [vertices, indices, matrix])
    }

    /// `corners`, rounded so that the format holds them exactly (but for a third component that it has not), each vertex
    /// `padding` bytes behind the one before.
    pub fn of(corners: &Corners, vertex_format: VertexFormat, index_format: IndexFormat, padding: u32) -> Owned {
        let bytes = vertex_format.component_bytes();
        let vertex_stride = bytes * vertex_format.components() + padding;
        let mut vertices = Vec::new();
        for vertex in corners.iter().flatten() {
            let begin = vertices.len();
            for &x in &vertex[..vertex_format.components() as usize] {
                let eighth = (8.0 * x).round() / 8.0;
                match (bytes, vertex_format) {
                    (4, _) => vertices.extend_from_slice(&eighth.to_le_bytes()),
                    (_, VertexFormat::SNORM2 | VertexFormat::SNORM3) => {
                        vertices.extend_from_slice(&((x.clamp(-1.0, 1.0) * 32767.0) as i16).to_le_bytes());
                    }
                    _ => vertices.extend_from_slice(&half(eighth).to_le_bytes()),
                }
            }
            vertices.resize(begin + vertex_stride as usize, 0x5a);
        }
        let count = 3 * corners.len() as u32;
        let indices = (0..count).flat_map(|i| i.to_le_bytes()[..index_format.bytes() as usize].to_vec()).collect();
        Owned {
            vertices,
            vertex_stride,
            vertex_count: count,
            vertex_format,
            indices,
            index_format,
            transform: None,
            primitive_count: corners.len() as u32,
        }
    }
}
