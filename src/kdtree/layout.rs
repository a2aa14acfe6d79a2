//! `KdTree`: the bytes that builders write and tracers read.
//!
//! A structure is one range of memory, position-independent, little-endian:
//!
//! | part | bytes | at |
//! | --- | --- | --- |
//! | [`KdHeader`] | 128 | 0 |
//! | [`KdNode`] × `node_room` | 8 each | [`NODES_OFFSET`] |
//! | references × `reference_room` | 4 each: index of a record | [`KdOffsets::references_offset`] |
//! | [`Triangle`] × `record_room` | 40 each | [`KdOffsets::records_offset`], a multiple of 8 |
//! | [`GeometryEntry`] × `geometry_count`, where that is over 1 | 8 each | [`KdOffsets::geometries_offset`] |
//!
//! The first node is the root. An empty leaf has no node: its parent says that it is empty, and a ray that would go there needs no
//! load to know it. Builders write the nodes level by level, in each the children in the order of their parents, left before right,
//! and the references in the order of the leaves: what a device that builds level by level gets from prefix sums.
//! The records are the triangles that are not left out, in the order of the input. Of each part as much is used as the counts say
//! (`node_count`, `reference_count`, `active`); there is room for more where other trees are to be merged into this one. What a
//! merge adds stands behind what there was, in any order; what it puts nothing in place of stays where it is.
//!
//! A cell is what is left of the box in the header where the planes of the nodes above have cut it.

use crate::bvh::layout::{self as bvh, GeometryEntry, Triangle};
use crate::geometry::Aabb;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// The second word of a structure; the version in the low half is that of all our layouts.
pub const KIND: u32 = 0x0032_0000 | bvh::VERSION;
/// Where the nodes begin.
pub const NODES_OFFSET: u64 = size_of::<KdHeader>() as u64;
/// The deepest tree that a tracer must be able to walk: [`super::termination::depth_limit`] of 2³² primitives is 41.
pub const MAX_DEPTH: u32 = 41;
/// The most nodes there can be: 28 bits name a child.
pub const MAX_NODES: u64 = 1 << 28;
/// The most references there can be: 30 bits name a leaf's first.
pub const MAX_REFERENCES: u64 = 1 << 30;

/// The head of a structure. 128 bytes; the first four words are those of [`bvh::Header`].
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct KdHeader {
    /// [`bvh::MAGIC`].
    pub magic: u32,
    /// [`KIND`].
    pub kind: u32,
    /// Bits of [`bvh::status`].
    pub status: u32,
    /// Primitives of the input.
    pub primitive_count: u32,
    /// Least corner of the root's cell, which holds all triangles and what rounding may move a hit by; of an empty structure,
    /// [`Aabb::EMPTY`]'s.
    pub lo: [f32; 3],
    /// Nodes there are.
    pub node_count: u32,
    /// Greatest corner of the root's cell.
    pub hi: [f32; 3],
    /// References of all leaves together.
    pub reference_count: u32,
    /// Records: primitives of the input that are finite and whose indices are in range.
    pub active: u32,
    /// Nodes that are split.
    pub inner_nodes: u32,
    /// Leaves that hold something: the other nodes.
    pub leaves: u32,
    /// Leaves that hold nothing, and have no node.
    pub empty_leaves: u32,
    /// Geometries of the input.
    pub geometry_count: u32,
    /// The flags that all geometries have, and those that any has in the byte above.
    pub geometry_flags: u32,
    /// `vk::BuildAccelerationStructureFlagsKHR` that it was built with.
    pub build_flags: u32,
    /// Depth of the deepest node; the root has depth 0.
    pub depth: u32,
    /// What lengths were scaled by before areas were taken: [`crate::bvh::sah::area_scale`] of the root's cell.
    pub area_scale: f32,
    /// The longest side of a triangle that is referenced only where it is: rays look as far beside themselves as hits of such a one
    /// may be ([`crate::trace::twin::kd`]).
    pub reach: f32,
    /// Nodes that there is room for: a merge may add some. By default no more than there are.
    pub node_room: u32,
    /// References that there is room for.
    pub reference_room: u32,
    /// Records that there is room for.
    pub record_room: u32,
    /// Nodes that a merge has put others in place of, and that none names any more; 0 in a tree that nothing is merged into.
    pub replaced_nodes: u32,
    /// References that were those of leaves that a merge has put others in place of, and that are in no leaf any more.
    pub replaced_references: u32,
    /// Zero.
    pub reserved: [u32; 5],
}

/// An inner node or a leaf. 8 bytes.
///
/// | | word 0 | word 1, bits 0–1 | bit 2 | bit 3 | the others |
/// | --- | --- | --- | --- | --- | --- |
/// | inner | the plane, an `f32` | its axis, 0–2 | left child is empty | right child is empty | 28 bits: first child that is not |
/// | leaf | number of references, at least 1 | 3 | 30 bits from here on: first reference | | |
///
/// Where neither child is empty, the right one is beside the left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct KdNode {
    /// See the table.
    pub first: u32,
    /// See the table.
    pub second: u32,
}

/// What a [`KdNode`] says.
#[derive(Debug, Clone, PartialEq)]
pub enum KdContent {
    /// A cell that is split.
    Inner(Inner),
    /// A cell that is not: its part of the references.
    Leaf(Range<usize>),
}

/// An inner node taken apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inner {
    /// The axis that the plane is across.
    pub axis: usize,
    /// Where the plane is.
    pub plane: f32,
    /// The nodes of the left child (lesser coordinates) and of the right; `None` where one is empty.
    pub children: [Option<u32>; 2],
}

const LEAF: u32 = 3;

impl KdNode {
    /// A node that is split. `first_child` is the node of the first child that is not `empty`, less than [`MAX_NODES`].
    pub fn inner(axis: usize, plane: f32, first_child: u32, empty: [bool; 2]) -> KdNode {
        let [left, right] = empty.map(u32::from);
        KdNode { first: plane.to_bits(), second: axis as u32 | left << 2 | right << 3 | first_child << 4 }
    }

    /// A leaf of `count` references from `first` on, which is less than [`MAX_REFERENCES`].
    pub fn leaf(first: u32, count: u32) -> KdNode {
        KdNode { first: count, second: LEAF | first << 2 }
    }

    /// The node taken apart.
    pub fn content(&self) -> KdContent {
        let KdNode { first, second } = *self;
        if second & 3 == LEAF {
            let from = (second >> 2) as usize;
            return KdContent::Leaf(from..from + first as usize);
        }
        let (is_left, is_right) = (second & 4 == 0, second & 8 == 0);
        let child = second >> 4;
        let children = [is_left.then_some(child), is_right.then(|| child + u32::from(is_left))];
        KdContent::Inner(Inner { axis: (second & 3) as usize, plane: f32::from_bits(first), children })
    }
}

impl Inner {
    /// What the plane makes of a cell: left and right.
    pub fn halves(&self, cell: &Aabb) -> [Aabb; 2] {
        halves(cell, self.axis, self.plane)
    }
}

/// The two parts of a cell on the sides of a plane.
#[doc(hidden)]
pub fn halves(cell: &Aabb, axis: usize, plane: f32) -> [Aabb; 2] {
    let [mut left, mut right] = [*cell; 2];
    left.hi[axis] = plane;
    right.lo[axis] = plane;
    [left, right]
}

/// Where the parts of a structure lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KdOffsets {
    /// Byte offset of the references.
    pub references_offset: u64,
    /// Byte offset of the records.
    pub records_offset: u64,
    /// Byte offset of the table of geometries.
    pub geometries_offset: u64,
    /// Bytes in all.
    pub bytes: u64,
}

impl KdHeader {
    /// The root's cell.
    pub fn cell(&self) -> Aabb {
        Aabb { lo: self.lo, hi: self.hi }
    }

    /// Where the parts of the structure lie.
    pub const fn offsets(&self) -> KdOffsets {
        let references_offset = NODES_OFFSET + self.node_room as u64 * size_of::<KdNode>() as u64;
        let records_offset =
            references_offset + (self.reference_room as u64 * size_of::<u32>() as u64).next_multiple_of(8);
        let geometries_offset = records_offset + self.record_room as u64 * size_of::<Triangle>() as u64;
        let entries = if self.geometry_count > 1 { self.geometry_count as u64 } else { 0 };
        let bytes = geometries_offset + entries * size_of::<GeometryEntry>() as u64;
        KdOffsets { references_offset, records_offset, geometries_offset, bytes }
    }
}

const _: () = assert!(size_of::<KdHeader>() == 128 && size_of::<KdNode>() == 8);
const _: () =
    assert!(std::mem::offset_of!(KdHeader, primitive_count) == std::mem::offset_of!(bvh::Header, primitive_count));

/// How much more a structure has room for than it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SpareRoom {
    /// Nodes.
    pub nodes: u32,
    /// References.
    pub references: u32,
    /// Records.
    pub records: u32,
}

/// A structure on the host, read back or built there.
#[derive(Debug, Clone)]
pub struct KdTree {
    /// The head.
    pub header: KdHeader,
    /// The nodes, the root first.
    pub nodes: Vec<KdNode>,
    /// Indices of records, those of each leaf together and ascending.
    pub references: Vec<u32>,
    /// The triangles, in the order of the input.
    pub records: Vec<Triangle>,
    /// The table of geometries; empty where there is one.
    pub geometries: Vec<GeometryEntry>,
}

impl KdTree {
    /// Takes a structure's bytes apart; what lies behind them is of no interest.
    ///
    /// # Errors
    /// [`Error::InvalidStructure`] if the magic, kind or length is not that of a kd-tree.
    pub fn from_bytes(bytes: &[u8]) -> Result<KdTree> {
        let header: KdHeader = bvh::header_of(bytes, KIND)?;
        let sizes = header.offsets();
        if (bytes.len() as u64) < sizes.bytes {
            return Err(Error::InvalidStructure(format!(
                "{} bytes, {} nodes, {} references and {} records need {}; is it cut off?",
                bytes.len(),
                header.node_room,
                header.reference_room,
                header.record_room,
                sizes.bytes
            )));
        }
        if header.node_count > header.node_room
            || header.reference_count > header.reference_room
            || header.active > header.record_room
        {
            return Err(Error::InvalidStructure(format!(
                "{} nodes, {} references and {} records where there is room for {}, {} and {}",
                header.node_count,
                header.reference_count,
                header.active,
                header.node_room,
                header.reference_room,
                header.record_room
            )));
        }
        Ok(KdTree {
            header,
            nodes: part(bytes, NODES_OFFSET, header.node_count),
            references: part(bytes, sizes.references_offset, header.reference_count),
            records: part(bytes, sizes.records_offset, header.active),
            geometries: if header.geometry_count > 1 {
                part(bytes, sizes.geometries_offset, header.geometry_count)
            } else {
                Vec::new()
            },
        })
    }

    /// The same tree with so much room behind what it has.
    ///
    /// # Errors
    /// [`Error::Argument`] if there would be room for more than the layout can name.
    pub fn with_room(mut self, more: SpareRoom) -> Result<KdTree> {
        let KdHeader { node_count, reference_count, active, .. } = self.header;
        let room = |what: &str, count: u32, more: u32, most: u64| {
            let room = u64::from(count) + u64::from(more);
            u32::try_from(room).ok().filter(|_| room <= most).ok_or_else(|| {
                Error::Argument(format!("room for {room} {what}, the most is {most}; take less or a smaller scene"))
            })
        };
        self.header.node_room = room("nodes", node_count, more.nodes, MAX_NODES)?;
        self.header.reference_room = room("references", reference_count, more.references, MAX_REFERENCES)?;
        self.header.record_room = room("records", active, more.records, u32::MAX.into())?;
        Ok(self)
    }

    /// The structure's bytes, as the device has them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let KdOffsets { references_offset, records_offset, geometries_offset, .. } = self.header.offsets();
        let mut bytes = bytemuck::bytes_of(&self.header).to_vec();
        bytes.extend_from_slice(bytemuck::cast_slice(&self.nodes));
        bytes.resize(references_offset as usize, 0);
        bytes.extend_from_slice(bytemuck::cast_slice(&self.references));
        bytes.resize(records_offset as usize, 0);
        bytes.extend_from_slice(bytemuck::cast_slice(&self.records));
        bytes.resize(geometries_offset as usize, 0);
        bytes.extend_from_slice(bytemuck::cast_slice(&self.geometries));
        bytes
    }
}

/// So many of what lies at an offset of the bytes; within them.
fn part<T: Pod>(bytes: &[u8], offset: u64, count: u32) -> Vec<T> {
    let end = offset as usize + size_of::<T>() * count as usize;
    bytemuck::pod_collect_to_vec(&bytes[offset as usize..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_says_what_it_was_made_of() {
        let child = MAX_NODES as u32 - 2;
        for (empty, children) in [
            ([false, false], [Some(child), Some(child + 1)]),
            ([true, false], [None, Some(child)]),
            ([false, true], [Some(child), None]),
        ] {
            for axis in 0..3 {
                let node = KdNode::inner(axis, -0.1, child, empty);
                assert_eq!(node.content(), KdContent::Inner(Inner { axis, plane: -0.1, children }));
            }
        }
        let last = MAX_REFERENCES as u32 - 1;
        assert_eq!(KdNode::leaf(last, 1).content(), KdContent::Leaf(last as usize..last as usize + 1));
    }

    #[test]
    fn bytes_that_are_no_kd_tree_are_refused_by_name() {
        let header = KdHeader {
            magic: bvh::MAGIC,
            kind: KIND,
            node_count: 1,
            reference_count: 1,
            node_room: 1,
            reference_room: 1,
            ..KdHeader::zeroed()
        };
        let tree = KdTree {
            header,
            nodes: vec![KdNode::leaf(0, 1)],
            references: vec![0],
            records: Vec::new(),
            geometries: Vec::new(),
        };
        let bytes = tree.to_bytes();
        assert_eq!(KdTree::from_bytes(&bytes).expect("its own bytes").to_bytes(), bytes);
        let longer = KdTree::from_bytes(&[&bytes[..], &[1, 2, 3]].concat()).expect("bytes that something lies behind");
        assert_eq!(longer.to_bytes(), bytes);
        let error_of = |bytes: &[u8]| KdTree::from_bytes(bytes).expect_err("broken").to_string();
        assert!(error_of(&bytes[..100]).contains("100 bytes, the header alone has 128"));
        assert!(error_of(&bytes[..139]).contains("139 bytes, 1 nodes, 1 references and 0 records need 144"));
        let mut other = bytes.clone();
        other[4] ^= 1;
        assert!(error_of(&other).contains("of another kind or version"));
        let roomy = KdTree { header: KdHeader { node_room: 3, reference_room: 2, ..header }, ..tree };
        let more = roomy.to_bytes();
        assert_eq!(more.len(), 128 + 3 * 8 + 2 * 4);
        assert_eq!(KdTree::from_bytes(&more).expect("room for more").references, [0]);
        let full = KdTree { header: KdHeader { node_count: 4, ..roomy.header }, ..roomy };
        assert!(
            error_of(&full.to_bytes()[..more.len()])
                .contains("4 nodes, 1 references and 0 records where there is room for 3")
        );
    }
}
