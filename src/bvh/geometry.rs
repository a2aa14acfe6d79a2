//! The caller's triangles: vertices and indices in the formats that Vulkan's acceleration structures take.
//!
//! `glsl/bvh/geometry.glsl` reads them on the device; [`host`](super::twin::geometry) does the same on the host.

use crate::{Error, Result};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Triangles with vertices and indices of one format, at device addresses. 40 bytes, the same on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Geometry {
    /// Address of vertex 0, aligned to the size of a component.
    pub vertices: u64,
    /// Address of the first index, aligned to its size; without meaning for [`IndexFormat::NONE`].
    pub indices: u64,
    /// Address of a 3×4 matrix of `f32`, row by row, that every vertex is multiplied with; 4-byte aligned. 0: none.
    pub transform: u64,
    /// Bytes from one vertex to the next, a multiple of the size of a component.
    pub vertex_stride: u32,
    /// The number of vertices. Triangles whose indices are out of range are left out.
    pub vertex_count: u32,
    /// The vertices' format.
    pub vertex_format: VertexFormat,
    /// The indices' format.
    pub index_format: IndexFormat,
    /// How rays meet it.
    pub flags: GeometryFlags,
    /// The index of its first primitive: the number of primitives in the geometries before it.
    pub first: u32,
}

impl Geometry {
    /// Three floats a vertex, one vertex after the other; three 32-bit indices a triangle.
    pub fn mesh(positions: u64, vertex_count: u32, indices: u64) -> Geometry {
        Geometry {
            vertices: positions,
            indices,
            transform: 0,
            vertex_stride: 12,
            vertex_count,
            vertex_format: VertexFormat::FLOAT3,
            index_format: IndexFormat::U32,
            flags: GeometryFlags::NONE,
            first: 0,
        }
    }

    /// Boxes as `VkAabbPositionsKHR` has them, six floats each, `stride` bytes from one to the next.
    pub fn boxes(address: u64, stride: u32) -> Geometry {
        Geometry { vertex_stride: stride, ..Geometry::mesh(address, 0, 0) }
    }

    /// The formats as the device has them, in one word.
    pub(crate) fn formats(&self) -> u32 {
        bytemuck::cast([self.vertex_format.kind, self.vertex_format.components, self.index_format.0, self.flags.0])
    }

    /// Whether it is of the formats of [`Geometry::mesh`], with any stride: these have kernels of their own, in which a vertex's
    /// words have numbers below 2^31.
    pub(crate) fn is_plain(&self) -> bool {
        let bytes = u64::from(self.vertex_count) * u64::from(self.vertex_stride);
        let is_near = bytes <= 4 << 31;
        let formats = self.vertex_format == VertexFormat::FLOAT3 && self.index_format == IndexFormat::U32;
        self.transform == 0 && formats && is_near
    }
}

/// How a vertex lies in memory: the kind of its components, and how many of them are read (a third that is not read is 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Pod, Zeroable)]
#[repr(C)]
pub struct VertexFormat {
    kind: u8,
    components: u8,
}

impl VertexFormat {
    /// `VK_FORMAT_R32G32B32_SFLOAT`.
    pub const FLOAT3: VertexFormat = VertexFormat { kind: 0, components: 3 };
    /// `VK_FORMAT_R32G32_SFLOAT`.
    pub const FLOAT2: VertexFormat = VertexFormat { kind: 0, components: 2 };
    /// `VK_FORMAT_R16G16B16A16_SFLOAT`, the fourth left out; also `VK_FORMAT_R16G16B16_SFLOAT`.
    pub const HALF3: VertexFormat = VertexFormat { kind: 1, components: 3 };
    /// `VK_FORMAT_R16G16_SFLOAT`.
    pub const HALF2: VertexFormat = VertexFormat { kind: 1, components: 2 };
    /// `VK_FORMAT_R16G16B16A16_SNORM`, the fourth left out; also `VK_FORMAT_R16G16B16_SNORM`. A component c stands for
    /// c · fl(1/32767), at least −1.
    pub const SNORM3: VertexFormat = VertexFormat { kind: 2, components: 3 };
    /// `VK_FORMAT_R16G16_SNORM`.
    pub const SNORM2: VertexFormat = VertexFormat { kind: 2, components: 2 };

    /// Every format.
    pub const ALL: [VertexFormat; 6] =
        [Self::FLOAT3, Self::FLOAT2, Self::HALF3, Self::HALF2, Self::SNORM3, Self::SNORM2];

    /// Bytes of a component.
    pub fn component_bytes(self) -> u32 {
        if self.kind == Self::FLOAT3.kind { 4 } else { 2 }
    }

    /// Components that are read: two or three.
    pub fn components(self) -> u32 {
        self.components.into()
    }

    pub(crate) fn is_half(self) -> bool {
        self.kind == Self::HALF3.kind
    }
}

impl TryFrom<vk::Format> for VertexFormat {
    type Error = Error;

    fn try_from(format: vk::Format) -> Result<VertexFormat> {
        match format {
            vk::Format::R32G32B32_SFLOAT | vk::Format::R32G32B32A32_SFLOAT => Ok(VertexFormat::FLOAT3),
            vk::Format::R32G32_SFLOAT => Ok(VertexFormat::FLOAT2),
            vk::Format::R16G16B16A16_SFLOAT | vk::Format::R16G16B16_SFLOAT => Ok(VertexFormat::HALF3),
            vk::Format::R16G16_SFLOAT => Ok(VertexFormat::HALF2),
            vk::Format::R16G16B16A16_SNORM | vk::Format::R16G16B16_SNORM => Ok(VertexFormat::SNORM3),
            vk::Format::R16G16_SNORM => Ok(VertexFormat::SNORM2),
            other => Err(Error::Argument(format!(
                "vertexFormat {other:?} cannot be built from; take 32-bit or 16-bit floats or 16-bit snorm, two or three of them"
            ))),
        }
    }
}

/// Bytes of an index; none where the vertices are taken in their order, three a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Pod, Zeroable)]
#[repr(transparent)]
pub struct IndexFormat(u8);

impl IndexFormat {
    /// `VK_INDEX_TYPE_NONE_KHR`.
    pub const NONE: IndexFormat = IndexFormat(0);
    /// `VK_INDEX_TYPE_UINT8_KHR`.
    pub const U8: IndexFormat = IndexFormat(1);
    /// `VK_INDEX_TYPE_UINT16`.
    pub const U16: IndexFormat = IndexFormat(2);
    /// `VK_INDEX_TYPE_UINT32`.
    pub const U32: IndexFormat = IndexFormat(4);

    /// Every format.
    pub const ALL: [IndexFormat; 4] = [Self::NONE, Self::U8, Self::U16, Self::U32];

    /// Bytes of an index.
    pub fn bytes(self) -> u32 {
        self.0.into()
    }
}

impl TryFrom<vk::IndexType> for IndexFormat {
    type Error = Error;

    fn try_from(index_type: vk::IndexType) -> Result<IndexFormat> {
        match index_type {
            vk::IndexType::NONE_KHR => Ok(IndexFormat::NONE),
            vk::IndexType::UINT8_EXT => Ok(IndexFormat::U8),
            vk::IndexType::UINT16 => Ok(IndexFormat::U16),
            vk::IndexType::UINT32 => Ok(IndexFormat::U32),
            other => Err(Error::Argument(format!(
                "indexType {other:?} cannot be built from; take indices of 8, 16 or 32 bits or none"
            ))),
        }
    }
}

/// How rays meet a geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Pod, Zeroable)]
#[repr(transparent)]
pub struct GeometryFlags(u8);

impl GeometryFlags {
    /// The shader decides on every meeting.
    pub const NONE: GeometryFlags = GeometryFlags(0);
    /// Every meeting is a hit.
    pub const OPAQUE: GeometryFlags = GeometryFlags(super::layout::GEOMETRY_OPAQUE as u8);
    /// A primitive is met once by a ray. It is, but for triangles that are split ([`super::split`]): a build refuses to split a
    /// geometry with this flag that it is told of; of several, it is the caller's to know.
    pub const NO_DUPLICATES: GeometryFlags = GeometryFlags(1 << 1);
    /// The record that ends the others: primitives from its `first` on are inactive.
    pub const END: GeometryFlags = GeometryFlags(1 << 7);

    /// The bits of the flags in a structure.
    pub fn bits(self) -> u32 {
        self.0.into()
    }
}

impl std::ops::BitOr for GeometryFlags {
    type Output = GeometryFlags;

    fn bitor(self, other: GeometryFlags) -> GeometryFlags {
        GeometryFlags(self.0 | other.0)
    }
}

/// What the primitives of a structure are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Primitives {
    /// Triangles; records are [`super::layout::Triangle`]s.
    Triangles,
    /// Boxes; records are [`super::layout::BoxRecord`]s.
    Boxes,
    /// Instances or parts of them; records are [`super::layout::InstanceRecord`]s.
    Instances,
}

impl Primitives {
    /// Bytes of a record.
    pub const fn record_bytes(self) -> u64 {
        match self {
            Primitives::Triangles => size_of::<super::layout::Triangle>() as u64,
            Primitives::Boxes => size_of::<super::layout::BoxRecord>() as u64,
            Primitives::Instances => size_of::<super::layout::InstanceRecord>() as u64,
        }
    }
}

/// What a build reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Input {
    /// The geometries.
    pub source: Source,
    /// Primitives of all geometries.
    pub primitive_count: u32,
}

/// Where the geometries are named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// In the recording itself.
    One(Geometry),
    /// In device memory: `count` [`Geometry`] records at an address aligned to 8 bytes, at least one, in the order of their
    /// `first`, that of the first being 0.
    Several {
        /// Address of the records.
        records: u64,
        /// How many there are; one more than was planned for where a last one ends the others.
        count: u32,
    },
    /// The entries of a top level, `glsl/bvh/instances.glsl`, in device memory: 48 bytes each at an address aligned to 8 bytes.
    Entries(u64),
}

impl Input {
    /// One geometry as [`Geometry::mesh`] has it.
    pub fn mesh(positions: u64, vertex_count: u32, indices: u64, primitive_count: u32) -> Input {
        Input { source: Source::One(Geometry::mesh(positions, vertex_count, indices)), primitive_count }
    }

    /// Specialisation constant 5 of the kernels that read primitives: `SOURCE` in geometry.glsl.
    pub(crate) fn source_constant(&self, primitives: Primitives) -> u32 {
        match (primitives, self.source) {
            (Primitives::Triangles, Source::One(geometry)) if geometry.is_plain() => SOURCE_MESH,
            (Primitives::Triangles, Source::One(_)) => SOURCE_GEOMETRY,
            (Primitives::Triangles, _) => SOURCE_GEOMETRIES,
            (Primitives::Boxes, Source::One(_)) => SOURCE_BOXES,
            (Primitives::Boxes, _) => SOURCE_SEVERAL_BOXES,
            (Primitives::Instances, _) => SOURCE_ENTRIES,
        }
    }

    /// The geometry as the kernels are given it, and its formats.
    pub(crate) fn for_kernels(&self) -> (Geometry, u32) {
        match self.source {
            Source::One(geometry) => (geometry, geometry.formats()),
            // The address of the records, and how many there are.
            Source::Several { records, count } => {
                (Geometry { vertex_count: count, ..Geometry::mesh(records, 0, 0) }, 0)
            }
            Source::Entries(entries) => (Geometry::mesh(entries, 0, 0), 0),
        }
    }
}

const SOURCE_MESH: u32 = 0;
const SOURCE_GEOMETRY: u32 = 1;
const SOURCE_GEOMETRIES: u32 = 2;
const SOURCE_BOXES: u32 = 3;
const SOURCE_SEVERAL_BOXES: u32 = 4;
const SOURCE_ENTRIES: u32 = 5;

/// The inputs that kernels and memory were planned for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Planned {
    pub primitives: Primitives,
    pub primitive_count: u32,
    pub geometry_count: u32,
}

impl Planned {
    /// # Errors
    /// `input` is another.
    pub fn check(&self, input: &Input) -> Result<()> {
        let refuse = |planned: String, has: String| {
            Err(Error::Argument(format!("planned for {planned}, the input has {has}; plan for what it has")))
        };
        if input.primitive_count != self.primitive_count {
            return refuse(format!("{} primitives", self.primitive_count), input.primitive_count.to_string());
        }
        if let Source::Several { count, .. } = input.source
            && count != self.geometry_count
            && count != self.geometry_count + 1
        {
            return refuse(format!("{} geometries", self.geometry_count), count.to_string());
        }
        let is_entries = matches!(input.source, Source::Entries(_));
        if is_entries != (self.primitives == Primitives::Instances) {
            return refuse(format!("{:?}", self.primitives), format!("{:?}", input.source));
        }
        Ok(())
    }
}

const _: () = assert!(size_of::<Geometry>() == 40);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_beyond_31_bits_of_words_are_read_by_64_bit_addresses() {
        let source = |vertex_count, vertex_stride| {
            let geometry = Geometry { vertex_count, vertex_stride, ..Geometry::mesh(16, 3, 16) };
            Input { source: Source::One(geometry), primitive_count: 1 }.source_constant(Primitives::Triangles)
        };
        assert_eq!(source(1 << 29, 16), SOURCE_MESH);
        assert_eq!(source((1 << 29) + 1, 16), SOURCE_GEOMETRY);
    }
}
