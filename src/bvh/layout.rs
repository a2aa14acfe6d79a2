//! `Bvh2`: the bytes that builders write and tracers read, on the device and on the host (glsl/bvh/layout.glsl).
//!
//! A structure is one range of memory, position-independent:
//!
//! | part | bytes | at |
//! | --- | --- | --- |
//! | [`Header`] | 128 | 0 |
//! | [`Node`] × `node_slots` | 64 each | [`NODES_OFFSET`] |
//! | [`Triangle`] × `primitive_count` | 40 each | behind the nodes: [`Sizes::triangles_offset`] |
//!
//! A [`Child`] names either an inner node (`count` 0) or a leaf: `count` triangles from `index` on, in the *primitive order*,
//! which is the order of the triangle records. A slot that no child names is not part of the tree; what it holds may be the
//! subtree of a collapsed leaf or [`Node::UNUSED`], but no slot is named twice, by used and unused slots together: so every
//! node has one parent, and who climbs from any slot reaches the root or learns that the slot is not part of the tree.

use bytemuck::{Pod, Zeroable};

/// The first word of a structure.
pub const MAGIC: u32 = u32::from_le_bytes(*b"hdgr");
/// The second word: layout `Bvh2`, version 1.
pub const KIND_BVH2: u32 = 0x0002_0002;
/// Where the nodes begin.
pub const NODES_OFFSET: u64 = size_of::<Header>() as u64;
/// The deepest tree a tracer must be able to walk: every code bit and every index bit may cost a level.
pub const MAX_DEPTH: u32 = 96;

/// Bits of [`Header::status`]. Zero is a structure without a blemish.
pub mod status {
    /// A primitive with NaN or infinite vertices was left out.
    pub const NON_FINITE: u32 = 1 << 0;
    /// An index named a vertex that is not there; the primitive was left out.
    pub const INDEX_OUT_OF_RANGE: u32 = 1 << 1;
    /// The tree is deeper than [`super::MAX_DEPTH`].
    pub const TOO_DEEP: u32 = 1 << 2;
    /// A bounded spin ran out: the structure is not usable.
    pub const SPIN_RAN_OUT: u32 = 1 << 3;
    /// Bits of structures that cannot be traced: tracers take them as empty.
    pub const UNUSABLE: u32 = TOO_DEEP | SPIN_RAN_OUT;
}

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
    pub fn centroid(&self) -> [f32; 3] {
        std::array::from_fn(|i| 0.5 * self.lo[i] + 0.5 * self.hi[i])
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f32 {
        let [x, y, z] = self.extent();
        (x * x + y * y + z * z).sqrt()
    }

    /// Whether `other` lies inside, touching allowed.
    pub fn contains(&self, other: &Aabb) -> bool {
        (0..3).all(|i| self.lo[i] <= other.lo[i] && other.hi[i] <= self.hi[i])
    }
}

/// What a node says of one child: its box and where it is. 32 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Child {
    /// Least corner of the child's box.
    pub lo: [f32; 3],
    /// Node slot, or first triangle of the leaf.
    pub index: u32,
    /// Greatest corner of the child's box.
    pub hi: [f32; 3],
    /// 0: an inner node; otherwise the number of triangles in the leaf.
    pub count: u32,
}

impl Child {
    /// A child of an unused slot: a leaf of nothing.
    pub const UNUSED: Child = Child { lo: Aabb::EMPTY.lo, index: u32::MAX, hi: Aabb::EMPTY.hi, count: u32::MAX };

    /// The child's box.
    pub fn bounds(&self) -> Aabb {
        Aabb { lo: self.lo, hi: self.hi }
    }

    /// Whether the child is a leaf.
    pub fn is_leaf(&self) -> bool {
        self.count != 0
    }
}

/// An inner node. 64 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Left and right child.
    pub children: [Child; 2],
}

impl Node {
    /// A slot that names nothing.
    pub const UNUSED: Node = Node { children: [Child::UNUSED; 2] };
}

/// A triangle in the primitive order. 40 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Triangle {
    /// First vertex.
    pub v0: [f32; 3],
    /// Second vertex.
    pub v1: [f32; 3],
    /// Third vertex.
    pub v2: [f32; 3],
    /// Primitive index: position in the input.
    pub primitive: u32,
}

/// The head of a structure. 128 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: u32,
    /// [`KIND_BVH2`].
    pub kind: u32,
    /// Bits of [`status`].
    pub status: u32,
    /// Triangles of the input, and triangle records.
    pub primitive_count: u32,
    /// The root, with the box of the whole scene. Of an empty structure: an empty box, index 0, count 0 and `active` 0.
    pub root: Child,
    /// Triangles in the tree: those of the input that are finite and whose indices are in range.
    pub active: u32,
    /// Node slots there is room for: `primitive_count` − 1, at least 1.
    pub node_slots: u32,
    /// Code bits that the builder sorted by.
    pub code_bits: u32,
    /// Zero.
    pub reserved: [u32; 17],
}

/// Where the parts of a structure of `primitive_count` triangles lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// Byte offset of the triangle records.
    pub triangles_offset: u64,
    /// Bytes in all.
    pub bytes: u64,
}

/// The sizes of a `Bvh2` of `primitive_count` triangles.
pub const fn sizes(primitive_count: u32) -> Sizes {
    let triangles_offset = NODES_OFFSET + node_slots(primitive_count) as u64 * size_of::<Node>() as u64;
    Sizes { triangles_offset, bytes: triangles_offset + primitive_count as u64 * size_of::<Triangle>() as u64 }
}

/// Node slots of a `Bvh2` of `primitive_count` triangles.
pub const fn node_slots(primitive_count: u32) -> u32 {
    if primitive_count < 2 { 1 } else { primitive_count - 1 }
}

const _: () = assert!(size_of::<Header>() == 128 && size_of::<Node>() == 64 && size_of::<Triangle>() == 40);

/// A `Bvh2` on the host, read back or built there.
#[derive(Debug, Clone)]
pub struct Bvh2 {
    /// The head.
    pub header: Header,
    /// All node slots, used or not.
    pub nodes: Vec<Node>,
    /// The triangles in primitive order.
    pub triangles: Vec<Triangle>,
}

impl Bvh2 {
    /// Takes a structure's bytes apart.
    ///
    /// # Errors
    /// [`crate::Error::InvalidStructure`] if the magic, kind or length is not that of a `Bvh2`.
    pub fn from_bytes(bytes: &[u8]) -> crate::Result<Bvh2> {
        let invalid = |what: String| crate::Error::InvalidStructure(what);
        if bytes.len() < size_of::<Header>() {
            return Err(invalid(format!("{} bytes, the header alone has {}", bytes.len(), size_of::<Header>())));
        }
        let header: Header = bytemuck::pod_read_unaligned(&bytes[..size_of::<Header>()]);
        if header.magic != MAGIC || header.kind != KIND_BVH2 {
            return Err(invalid(format!(
                "begins with {:#x} {:#x}, not a Bvh2 of this version",
                header.magic, header.kind
            )));
        }
        let sizes = sizes(header.primitive_count);
        if (bytes.len() as u64) < sizes.bytes {
            let (has, needs) = (bytes.len(), sizes.bytes);
            return Err(invalid(format!("{has} bytes, {} triangles need {needs}", header.primitive_count)));
        }
        Ok(Bvh2 {
            header,
            nodes: bytemuck::pod_collect_to_vec(&bytes[NODES_OFFSET as usize..sizes.triangles_offset as usize]),
            triangles: bytemuck::pod_collect_to_vec(&bytes[sizes.triangles_offset as usize..sizes.bytes as usize]),
        })
    }

    /// The structure's bytes, as the device has them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = bytemuck::bytes_of(&self.header).to_vec();
        bytes.extend_from_slice(bytemuck::cast_slice(&self.nodes));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.triangles));
        bytes
    }
}
