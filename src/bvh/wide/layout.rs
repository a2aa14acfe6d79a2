//! `Wide4`, `Wide8` and the quantised `Wide8q`: the bytes of wide trees (glsl/bvh/wide.glsl).
//!
//! A structure is one range of memory that stands alone, position-independent, and without a gap:
//!
//! | part | bytes | at |
//! | --- | --- | --- |
//! | [`Header`] | 128 | 0 |
//! | nodes × `node_slots` | [`Form::node_bytes`] each | [`NODES_OFFSET`] |
//! | [`Record`] × `primitive_count` | 40, 28 or 128 each; of quantised trees two triangles may be one record of 56 ([`super::pairs`]) | behind the nodes |
//! | [`GeometryEntry`] × `geometry_count`, where that is over 1 | 8 each | behind the records |
//! | [`Aabb`] × 6, of a quantised top level that has something far ([`crate::bvh::far`]) | 24 each | behind the records |
//!
//! The header is that of a `Bvh2` with another `kind`: [`Form::kind`]. The root is node 0, always, even if the whole tree is a
//! leaf: then it has one child. `node_slots` are the nodes that there are, at least one, `primitive_count` the records in leaves.
//! Costs are those of the binary tree that it was made of. Children of a node that are nodes lie side by side.
//!
//! Nodes of floats hold [`Child`]ren as those of a `Bvh2` do, the first ones used, the others [`Child::UNUSED`]; records lie in
//! the order of the binary tree. [`super::quantised`] describes quantised ones.

use super::Form;
use super::pairs::{self, Places, SAVED_BY_PAIR};
use crate::bvh::far;
use crate::bvh::layout::{self, Child, GeometryEntry, Header, NODES_OFFSET, Record, Triangle, header_of};
use crate::geometry::Aabb;
use crate::{Error, Result};
use bytemuck::Pod;

/// Children of a node by their slots, those of four in the first ones.
pub type Slots = [Option<Child>; 8];

/// A node of a wide tree.
pub trait WideNode: Pod + PartialEq + std::fmt::Debug + Send + Sync {
    /// How it is written.
    const FORM: Form;

    /// Leaves of more records than this are nodes of their own. Where two records may be one, leaves of more than 51 are.
    const LEAF_MAX: u32;

    /// The node of these children, whose indices are final. There is at least one; those that are nodes (or long leaves) lie
    /// side by side in the order of their slots, and, of quantised nodes, the records of the leaves do.
    fn of(children: &Slots) -> Self;

    /// The node that is a leaf of `count` records from `first` on: of forms with a [`WideNode::LEAF_MAX`].
    fn of_long_leaf(first: u32, count: u32) -> Self;

    /// The node of a tree of nothing.
    fn empty() -> Self;

    /// The children, with boxes as tracers see them. A long leaf has none.
    fn children(&self) -> Slots;

    /// First record and records of a long leaf.
    fn long_leaf(&self) -> Option<(u32, u32)>;
}

impl<const W: usize> WideNode for [Child; W] {
    const FORM: Form = if W == 4 { Form::Four } else { Form::Eight };
    const LEAF_MAX: u32 = u32::MAX;

    fn of(children: &Slots) -> Self {
        std::array::from_fn(|i| children[i].unwrap_or(Child::UNUSED))
    }

    fn of_long_leaf(first: u32, count: u32) -> Self {
        unreachable!("{count} records from {first} on are no leaf too long for 32 bits")
    }

    fn empty() -> Self {
        [Child::UNUSED; W]
    }

    fn children(&self) -> Slots {
        std::array::from_fn(|i| self.get(i).copied().filter(|child| child.count != layout::UNUSED))
    }

    fn long_leaf(&self) -> Option<(u32, u32)> {
        None
    }
}

/// Nodes of four children as floats.
pub type Wide4<R = Triangle> = Wide<[Child; 4], R>;
/// Nodes of eight children as floats.
pub type Wide8<R = Triangle> = Wide<[Child; 8], R>;
/// Nodes of eight children as bytes.
pub type Wide8q<R = Triangle> = Wide<super::quantised::QuantisedNode, R>;

/// A wide tree on the host.
#[derive(Debug, Clone)]
pub struct Wide<N: WideNode, R: Record = Triangle> {
    /// The head.
    pub header: Header,
    /// The nodes, the root first.
    pub nodes: Vec<N>,
    /// What the leaves hold, in the order of memory.
    pub records: Vec<R>,
    /// Where they lie: what the first record and the count of a leaf mean.
    pub places: Places,
    /// The table of geometries; empty where there is one.
    pub geometries: Vec<GeometryEntry>,
    /// The boxes of what is far, by sides; empty where nothing is.
    pub far: Vec<Aabb>,
}

/// Whether two records that share an edge may be one.
pub(crate) fn is_paired<N: WideNode, R: Record>() -> bool {
    N::FORM.is_quantised() && R::KIND == Triangle::KIND
}

/// The most records of a leaf that is no node of its own.
pub(crate) fn leaf_max<N: WideNode, R: Record>() -> u32 {
    if is_paired::<N, R>() { pairs::LEAF_MAX } else { N::LEAF_MAX }
}

impl Form {
    /// Bytes of a structure of this many nodes, records of `record_bytes` bytes, and geometries.
    pub const fn bytes(self, record_bytes: u64, nodes: u32, primitive_count: u32, geometry_count: u32) -> u64 {
        let entries = if geometry_count > 1 { geometry_count as u64 } else { 0 };
        let entries = entries * size_of::<GeometryEntry>() as u64;
        NODES_OFFSET + nodes as u64 * self.node_bytes() + primitive_count as u64 * record_bytes + entries
    }

    /// Bytes of the structure that begins with `header`: what of the memory that was given to a build is in use.
    pub const fn bytes_in_use(self, header: &Header, record_bytes: u64) -> u64 {
        let without_pairs = self.bytes(record_bytes, header.node_slots, header.primitive_count, header.geometry_count);
        without_pairs.saturating_sub(header.pairs as u64 * SAVED_BY_PAIR) + far::bytes(header)
    }
}

impl<N: WideNode, R: Record> Wide<N, R> {
    /// The second word of such structures.
    pub const KIND: u32 = N::FORM.kind(R::KIND);

    /// Takes a structure's bytes apart; what lies behind them is of no interest.
    ///
    /// # Errors
    /// [`Error::InvalidStructure`] if the magic, kind or length is not that of such a structure.
    pub fn from_bytes(bytes: &[u8]) -> Result<Wide<N, R>> {
        let header: Header = header_of(bytes, Self::KIND)?;
        let needs = N::FORM.bytes_in_use(&header, size_of::<R>() as u64);
        if (bytes.len() as u64) < needs {
            let (has, nodes) = (bytes.len(), header.node_slots);
            return Err(Error::InvalidStructure(format!("{has} bytes, {nodes} nodes with their records need {needs}")));
        }
        let head = NODES_OFFSET as usize;
        let records = head + header.node_slots as usize * size_of::<N>();
        let entries = if header.geometry_count > 1 { header.geometry_count as usize } else { 0 };
        let far = (needs - far::bytes(&header)) as usize;
        let geometries = far - entries * size_of::<GeometryEntry>();
        let Some(records_there) = bytes.get(records..geometries) else {
            let (pairs, count) = (header.pairs, header.primitive_count);
            return Err(Error::InvalidStructure(format!("{pairs} pairs of {count} records: more than there are")));
        };
        let (records_there, places) = pairs::from_bytes(records_there, is_paired::<N, R>());
        Ok(Wide {
            header,
            nodes: bytemuck::pod_collect_to_vec(&bytes[head..records]),
            records: records_there,
            places,
            geometries: bytemuck::pod_collect_to_vec(&bytes[geometries..far]),
            far: bytemuck::pod_collect_to_vec(&bytes[far..needs as usize]),
        })
    }

    /// What a leaf holds, by its first record and its count.
    ///
    /// # Panics
    /// The tree has no such records.
    pub fn leaf(&self, first: u32, count: u32) -> &[R] {
        &self.records[self.places.records(first, count)]
    }

    /// The structure's bytes, as the device has them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = bytemuck::bytes_of(&self.header).to_vec();
        bytes.extend_from_slice(bytemuck::cast_slice(&self.nodes));
        bytes.extend_from_slice(&pairs::to_bytes(&self.records, &self.places));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.geometries));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.far));
        bytes
    }
}
