//! `Bvh2`: the bytes that builders write and tracers read, on the device and on the host (glsl/bvh/layout.glsl).
//!
//! A structure is one range of memory, position-independent:
//!
//! | part | bytes | at |
//! | --- | --- | --- |
//! | [`Header`] | 128 | 0 |
//! | [`Node`] × `node_slots` | 64 each | [`NODES_OFFSET`] |
//! | [`Record`] × `primitive_count` | 40, 28 or 128 each | behind the nodes: [`BvhOffsets::records_offset`] |
//! | [`GeometryEntry`] × `geometry_count`, where that is over 1 | 8 each | behind the records |
//! | [`Aabb`] × 6, of a top level that has something far ([`super::far`]) | 24 each | behind the records |
//!
//! A [`Child`] names either an inner node (`count` 0) or a leaf: `count` records from `index` on, in the *primitive order*,
//! which is the order of the records: [`Triangle`]s, [`BoxRecord`]s or, of a top level, [`InstanceRecord`]s. A slot that no child
//! names is unused: the `count` of its left child is [`UNUSED`], and nothing else of it means anything. The slots from
//! `active` − 1 on are unused.

use super::far;
use super::wide::Form;
use super::wide::pairs::SAVED_BY_PAIR;
use super::wide::quantised::QuantisedNode;
use crate::geometry::Aabb;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};

/// The first word of a structure.
pub const MAGIC: u32 = u32::from_le_bytes(*b"hdgr");
/// The version of the layout: the low half of every [`Record::KIND`].
pub const VERSION: u32 = Triangle::KIND & 0xFFFF;
/// The left child's `count` of a slot that no child names.
pub const UNUSED: u32 = u32::MAX;
/// Where the nodes begin.
pub const NODES_OFFSET: u64 = size_of::<Header>() as u64;
/// The deepest tree a tracer must be able to walk: every code bit and every index bit may cost a level.
pub const MAX_DEPTH: u32 = 96;
/// By what part of its distance from a ray's origin, along whichever axis that is most, tracers see a box widened:
/// 64 units of rounding, ε = 2⁻²⁴ each ([`crate::trace::slab`]).
pub const SLACK: f32 = f32::from_bits((127 - 18) << 23);

/// Bits of [`Header::status`]. Zero: nothing is wrong.
pub mod status {
    /// A primitive with NaN or infinite vertices was left out.
    pub const NON_FINITE: u32 = 1 << 0;
    /// An index named a vertex that is not there; the primitive was left out.
    pub const INDEX_OUT_OF_RANGE: u32 = 1 << 1;
    /// The tree is deeper than [`super::MAX_DEPTH`].
    pub const TOO_DEEP: u32 = 1 << 2;
    /// A bounded spin ran out: the structure is not usable.
    pub const SPIN_RAN_OUT: u32 = 1 << 3;
    /// An instance was left out: its matrix has no inverse, or it does not name a bottom-level structure.
    pub const BAD_INSTANCE: u32 = 1 << 4;
    /// Deserialised from what another version wrote: the structure is not usable.
    pub const WRONG_VERSION: u32 = 1 << 5;
    /// Subtrees at [`super::MAX_DEPTH`] became leaves: rays that come there test more than they should.
    pub const DEPTH_LIMITED: u32 = 1 << 6;
    /// Nodes of a kd-tree became leaves, as there was no room for what is below them: rays that come there test more than they
    /// should.
    pub const OUT_OF_ROOM: u32 = 1 << 7;
    /// Bits of structures that cannot be traced: tracers take them as empty.
    pub const UNUSABLE: u32 = TOO_DEEP | SPIN_RAN_OUT | WRONG_VERSION;

    /// The names of the bits that are set, for people.
    pub fn names(status: u32) -> Vec<String> {
        const NAMES: [(u32, &str); 8] = [
            (NON_FINITE, "not finite"),
            (INDEX_OUT_OF_RANGE, "index out of range"),
            (TOO_DEEP, "too deep"),
            (SPIN_RAN_OUT, "spin ran out"),
            (BAD_INSTANCE, "bad instance"),
            (WRONG_VERSION, "wrong version"),
            (DEPTH_LIMITED, "depth limited"),
            (OUT_OF_ROOM, "out of room"),
        ];
        let name = |bit: u32| NAMES.iter().find(|(b, _)| *b == 1 << bit).map(|(_, name)| (*name).to_owned());
        let is_set = |bit: &u32| status >> bit & 1 == 1;
        (0..u32::BITS).filter(is_set).map(|bit| name(bit).unwrap_or_else(|| format!("bit {bit}"))).collect()
    }
}

/// A child of a node: its box and where it is. 32 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Child {
    /// Least corner of the child's box.
    pub lo: [f32; 3],
    /// Node slot, or first record of the leaf.
    pub index: u32,
    /// Greatest corner of the child's box.
    pub hi: [f32; 3],
    /// 0: an inner node; otherwise the number of records in the leaf.
    pub count: u32,
}

impl Child {
    /// A child of an unused slot: an empty leaf.
    pub const UNUSED: Child = Child { lo: Aabb::EMPTY.lo, index: u32::MAX, hi: Aabb::EMPTY.hi, count: UNUSED };

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
    /// A slot that no node uses.
    pub const UNUSED: Node = Node { children: [Child::UNUSED; 2] };

    /// Whether a child names the slot.
    pub fn is_used(&self) -> bool {
        self.children[0].count != UNUSED
    }
}

/// What the leaves of a structure hold.
pub trait Record: Pod + PartialEq + std::fmt::Debug + Send + Sync {
    /// The second word of the structure.
    const KIND: u32;

    /// Position in the input.
    fn primitive(&self) -> u32;

    /// The box around it, if no other structure is needed to find it.
    fn bounds(&self) -> Option<Aabb>;

    /// The corners, if it is a triangle.
    fn corners(&self) -> Option<[[f32; 3]; 3]> {
        None
    }

    /// What an update makes of the record of a primitive that can no longer be met: no ray meets it, and no other primitive has
    /// such a record.
    fn left_out(primitive: u32) -> Self;

    /// Whether it is such a record.
    fn is_left_out(&self) -> bool {
        bytemuck::bytes_of(self) == bytemuck::bytes_of(&Self::left_out(self.primitive()))
    }
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

impl Record for Triangle {
    const KIND: u32 = 0x0002_0006;

    fn primitive(&self) -> u32 {
        self.primitive
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb::around(&[self.v0, self.v1, self.v2]))
    }

    fn corners(&self) -> Option<[[f32; 3]; 3]> {
        Some([self.v0, self.v1, self.v2])
    }

    /// Negative zeros: builders make zeros of all others.
    fn left_out(primitive: u32) -> Triangle {
        let zero = [-0.0; 3];
        Triangle { v0: zero, v1: zero, v2: zero, primitive }
    }
}

/// A box around something that the caller's shaders intersect, in the primitive order. 28 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BoxRecord {
    /// Least corner.
    pub lo: [f32; 3],
    /// Greatest corner.
    pub hi: [f32; 3],
    /// Primitive index: position in the input.
    pub primitive: u32,
}

impl Record for BoxRecord {
    const KIND: u32 = 0x0012_0006;

    fn primitive(&self) -> u32 {
        self.primitive
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(Aabb { lo: self.lo, hi: self.hi })
    }

    /// Inside out: tracers skip it.
    fn left_out(primitive: u32) -> BoxRecord {
        let Aabb { lo, hi } = Aabb::EMPTY;
        BoxRecord { lo, hi, primitive }
    }
}

/// An instance, or a part of one, in a top level. 128 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct InstanceRecord {
    /// World to object, row by row.
    pub to_object: [[f32; 4]; 3],
    /// Object to world, row by row: as the caller gave it.
    pub to_world: [[f32; 4]; 3],
    /// Address of the bottom-level structure.
    pub structure: u64,
    /// The caller's 24 bits, and the mask above them.
    pub index_and_mask: u32,
    /// The caller's 24 bits of offset in a shader binding table, and `vk::GeometryInstanceFlagsKHR` above them.
    pub offset_and_flags: u32,
    /// Position in the input.
    pub instance: u32,
    /// Where to begin in the bottom-level structure: in the lower 27 bits a [`Child`]'s index, above them its count, or
    /// [`InstanceRecord::UP_TO_LAST`]. Of quantised nodes a node's index, and above it the first five slots that are entered of it.
    pub start: u32,
    /// [`Header::node_slots`] of that structure; in the upper 5 bits what else rays need of it: `FORM_` constants.
    pub slots: u32,
    /// Records of that structure that may be looked at. Of quantised nodes, above 27 bits, the other three slots.
    pub records: u32,
}

impl InstanceRecord {
    /// In place of the count of a leaf that has at least as many records: they go up to the last that may be looked at.
    pub const UP_TO_LAST: u32 = 31;
    /// The leaves hold boxes, not triangles.
    pub const FORM_BOXES: u32 = 1 << InstanceRecord::INDEX_BITS;
    /// Left children are those that rays look into first that end at any hit.
    pub const FORM_LEFT_FIRST: u32 = 2 << InstanceRecord::INDEX_BITS;
    /// All geometries are opaque.
    pub const FORM_ALL_OPAQUE: u32 = 4 << InstanceRecord::INDEX_BITS;
    /// Some are.
    pub const FORM_ANY_OPAQUE: u32 = 8 << InstanceRecord::INDEX_BITS;
    /// Its nodes are [`QuantisedNode`]s.
    pub const FORM_QUANTISED: u32 = 16 << InstanceRecord::INDEX_BITS;
    /// All slots of a quantised node.
    pub const ALL_SLOTS: u32 = 0xFF;

    const INDEX_BITS: u32 = 27;
    const INDEX_MASK: u32 = (1 << InstanceRecord::INDEX_BITS) - 1;

    /// The record with what it knows of its structure: where it begins there, and what rays need of the header. Of quantised nodes
    /// it begins with slots of a node, which are `child.count` then, a bit each.
    #[must_use]
    pub fn over(self, child: &Child, header: &Header) -> InstanceRecord {
        let is_long = child.count >= InstanceRecord::UP_TO_LAST;
        let is_quantised = is_quantised(header.kind);
        let has_boxes = [BoxRecord::KIND, BOXES_8Q].contains(&header.kind);
        let forms = [
            (has_boxes, InstanceRecord::FORM_BOXES),
            (is_quantised, InstanceRecord::FORM_QUANTISED),
            (header.child_order != 0, InstanceRecord::FORM_LEFT_FIRST),
            (header.geometry_flags & GEOMETRY_OPAQUE != 0, InstanceRecord::FORM_ALL_OPAQUE),
            (header.geometry_flags >> 8 & GEOMETRY_OPAQUE != 0, InstanceRecord::FORM_ANY_OPAQUE),
        ];
        let form = forms.iter().map(|&(is_so, form)| if is_so { form } else { 0 }).sum::<u32>();
        if is_quantised {
            let [below, above] = [child.count & 31, child.count >> 5].map(|slots| slots << InstanceRecord::INDEX_BITS);
            let (start, records) = (child.index | below, header.primitive_count | above);
            return InstanceRecord { start, slots: header.node_slots | form, records, ..self };
        }
        InstanceRecord {
            start: child.index | child.count.min(InstanceRecord::UP_TO_LAST) << InstanceRecord::INDEX_BITS,
            slots: header.node_slots | form,
            records: if is_long { child.index + child.count } else { header.primitive_count },
            ..self
        }
    }

    /// Where it begins in its structure: a [`Child`]'s index and count; of quantised nodes a node, and which of its slots.
    pub fn begin(&self) -> [u32; 2] {
        let (index, count) = (self.start & InstanceRecord::INDEX_MASK, self.start >> InstanceRecord::INDEX_BITS);
        if self.slots & InstanceRecord::FORM_QUANTISED != 0 {
            return [index, count | self.records >> InstanceRecord::INDEX_BITS << 5];
        }
        [index, if count == InstanceRecord::UP_TO_LAST { self.records - index } else { count }]
    }
}

impl Record for InstanceRecord {
    const KIND: u32 = 0x0022_0006;

    fn primitive(&self) -> u32 {
        self.instance
    }

    fn bounds(&self) -> Option<Aabb> {
        None
    }

    /// Of no structure.
    fn left_out(instance: u32) -> InstanceRecord {
        InstanceRecord { instance, ..Zeroable::zeroed() }
    }
}

/// Where the primitives of a geometry begin among those of all, and its flags. 8 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct GeometryEntry {
    /// Its first primitive index.
    pub first: u32,
    /// [`GEOMETRY_OPAQUE`] and the other bits of [`crate::bvh::geometry::Geometry`].
    pub flags: u32,
}

/// A geometry's flag: what a ray meets of it is a hit without asking the shader.
pub const GEOMETRY_OPAQUE: u32 = 1 << 0;

/// The head of a structure. 128 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: u32,
    /// [`Record::KIND`] of what the leaves hold.
    pub kind: u32,
    /// Bits of [`status`].
    pub status: u32,
    /// Records: one a primitive of the input, or where triangles were split room for all their parts; of a compacted structure
    /// those of the tree.
    pub primitive_count: u32,
    /// The root, with the box of the whole scene. Of an empty structure: an empty box, index 0, count 0 and `active` 0.
    pub root: Child,
    /// Records in the tree: of the input's primitives those that are finite and whose indices are in range, or their parts.
    pub active: u32,
    /// Node slots there are, at least 1: `primitive_count` − 1; where triangles were paired, as many as pairs and what is alone need; of a
    /// compacted structure `inner_nodes`.
    pub node_slots: u32,
    /// Code bits that the builder sorted by.
    pub code_bits: u32,
    /// Nodes of the tree.
    pub inner_nodes: u32,
    /// Geometries of the input.
    pub geometry_count: u32,
    /// The flags that all geometries have, and those that any has in the byte above.
    pub geometry_flags: u32,
    /// `vk::BuildAccelerationStructureFlagsKHR` that it was built with.
    pub build_flags: u32,
    /// What lengths were scaled by before areas were taken at the last build: [`crate::bvh::sah::area_scale`].
    pub area_scale: f32,
    /// SAH cost as a sum of scaled half areas, by the costs of collapsing: as of now, and as of the last build.
    pub cost: f32,
    /// See `cost`.
    pub built_cost: f32,
    /// Scaled half area of the root at the last build.
    pub built_area: f32,
    /// Where triangles were split, and several records may be of one: primitives of the input. Otherwise 0.
    pub split_from: u32,
    /// 1: the children of all nodes have an order ([`crate::bvh::child_order`]), and the left one is what rays look into first that end
    /// at any hit. 0: they are as the build left them. Copies and updates keep it,
    /// and wide trees made of the structure have it.
    pub child_order: u32,
    /// Of a quantised tree of triangles: records that hold two ([`super::wide::pairs`]). Otherwise 0.
    pub pairs: u32,
    /// Of a top level that has something far ([`super::far`]): the node over what is not, where rays begin that meet nothing
    /// far. Otherwise 0.
    pub near_node: u32,
    /// On which sides of that node something is: a bit each.
    pub far_sides: u32,
    /// Zero.
    pub reserved: [u32; 4],
}

impl Header {
    /// SAH cost, divided by the root's area: as it is now (after updates). 0 for a root without area.
    pub fn sah(&self) -> f32 {
        ratio(self.cost, self.root.bounds().scaled_half_area(self.area_scale))
    }

    /// How many times the SAH cost is what it was at the last build: 1 until the first update.
    pub fn sah_growth(&self) -> f32 {
        ratio(self.sah(), ratio(self.built_cost, self.built_area))
    }
}

fn ratio(a: f32, b: f32) -> f32 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// Where the parts of a structure lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BvhOffsets {
    /// Byte offset of the records.
    pub records_offset: u64,
    /// Byte offset of the table of geometries.
    pub geometries_offset: u64,
    /// Bytes in all.
    pub bytes: u64,
}

/// The sizes of a structure of this many records of `record_bytes` bytes, with the most nodes that they can need.
pub const fn offsets(record_bytes: u64, primitive_count: u32, geometry_count: u32) -> BvhOffsets {
    offsets_with(record_bytes, node_slots(primitive_count), primitive_count, geometry_count)
}

/// The sizes of a structure of this many node slots, records of `record_bytes` bytes, and geometries.
pub const fn offsets_with(record_bytes: u64, node_slots: u32, primitive_count: u32, geometry_count: u32) -> BvhOffsets {
    let nodes = node_slots as u64 * size_of::<Node>() as u64;
    offsets_behind(nodes, primitive_count as u64 * record_bytes, geometry_count)
}

/// With nodes and records of so many bytes.
const fn offsets_behind(nodes: u64, records: u64, geometry_count: u32) -> BvhOffsets {
    let records_offset = NODES_OFFSET + nodes;
    let geometries_offset = records_offset + records;
    let entries = if geometry_count > 1 { geometry_count as u64 } else { 0 };
    let bytes = geometries_offset + entries * size_of::<GeometryEntry>() as u64;
    BvhOffsets { records_offset, geometries_offset, bytes }
}

/// Bytes of a record of this [`Record::KIND`]; `None` for an unknown kind.
pub const fn record_bytes(kind: u32) -> Option<u64> {
    match kind {
        Triangle::KIND | TRIANGLES_8Q => Some(size_of::<Triangle>() as u64),
        BoxRecord::KIND | BOXES_8Q => Some(size_of::<BoxRecord>() as u64),
        InstanceRecord::KIND | INSTANCES_8Q => Some(size_of::<InstanceRecord>() as u64),
        _ => None,
    }
}

const TRIANGLES_8Q: u32 = Form::EightQuantised.kind(Triangle::KIND);
const BOXES_8Q: u32 = Form::EightQuantised.kind(BoxRecord::KIND);
const INSTANCES_8Q: u32 = Form::EightQuantised.kind(InstanceRecord::KIND);

/// Whether the nodes of a structure of this kind are [`QuantisedNode`]s.
pub const fn is_quantised(kind: u32) -> bool {
    kind == TRIANGLES_8Q || kind == BOXES_8Q || kind == INSTANCES_8Q
}

/// Whether a structure of this kind is a top level.
pub const fn has_instances(kind: u32) -> bool {
    kind == InstanceRecord::KIND || kind == INSTANCES_8Q
}

/// Bytes of a node of a structure of this kind.
const fn node_bytes(kind: u32) -> u64 {
    if is_quantised(kind) { size_of::<QuantisedNode>() as u64 } else { size_of::<Node>() as u64 }
}

/// Node slots that `primitive_count` records need at most.
pub const fn node_slots(primitive_count: u32) -> u32 {
    if primitive_count < 2 { 1 } else { primitive_count - 1 }
}

const _: () = assert!(size_of::<Header>() == 128 && size_of::<Node>() == 64 && size_of::<Triangle>() == 40);
const _: () = assert!(size_of::<BoxRecord>() == 28 && size_of::<InstanceRecord>() == 128);
const _: () = assert!(BoxRecord::KIND & 0xFFFF == VERSION && InstanceRecord::KIND & 0xFFFF == VERSION);

/// The header that a structure's bytes begin with; the first two words of every one are [`MAGIC`] and the structure's kind.
pub(crate) fn header_of<H: Pod>(bytes: &[u8], kind: u32) -> Result<H> {
    let head = size_of::<H>();
    if bytes.len() < head {
        return Err(Error::InvalidStructure(format!("{} bytes, the header alone has {head}", bytes.len())));
    }
    let [magic, its_kind]: [u32; 2] = bytemuck::pod_read_unaligned(&bytes[..8]);
    if (magic, its_kind) != (MAGIC, kind) {
        return Err(Error::InvalidStructure(format!(
            "begins with {magic:#x} {its_kind:#x}, not with {MAGIC:#x} {kind:#x}: of another kind or version"
        )));
    }
    Ok(bytemuck::pod_read_unaligned(&bytes[..head]))
}

/// A structure on the host, read back or built there.
#[derive(Debug, Clone)]
pub struct Bvh2<R: Record = Triangle> {
    /// The head.
    pub header: Header,
    /// All node slots, used or not.
    pub nodes: Vec<Node>,
    /// What the leaves hold, in primitive order.
    pub records: Vec<R>,
    /// The table of geometries; empty where there is one.
    pub geometries: Vec<GeometryEntry>,
    /// The boxes of what is far, by sides; empty where nothing is.
    pub far: Vec<Aabb>,
}

impl<R: Record> Bvh2<R> {
    /// Takes a structure's bytes apart; what lies behind them is of no interest.
    ///
    /// # Errors
    /// [`Error::InvalidStructure`] if the magic, kind or length is not that of a structure of such records.
    pub fn from_bytes(bytes: &[u8]) -> Result<Bvh2<R>> {
        let header: Header = header_of(bytes, R::KIND)?;
        let offsets = header.offsets(size_of::<R>() as u64);
        if (bytes.len() as u64) < offsets.bytes {
            let (has, needs) = (bytes.len(), offsets.bytes);
            let what = format!("{has} bytes, {} primitives need {needs}", header.primitive_count);
            return Err(Error::InvalidStructure(what));
        }
        let far = offsets.bytes - far::bytes(&header);
        let part = |from: u64, to: u64| &bytes[from as usize..to as usize];
        Ok(Bvh2 {
            header,
            nodes: bytemuck::pod_collect_to_vec(part(NODES_OFFSET, offsets.records_offset)),
            records: bytemuck::pod_collect_to_vec(part(offsets.records_offset, offsets.geometries_offset)),
            geometries: bytemuck::pod_collect_to_vec(part(offsets.geometries_offset, far)),
            far: bytemuck::pod_collect_to_vec(part(far, offsets.bytes)),
        })
    }

    /// The structure's bytes, as the device has them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = bytemuck::bytes_of(&self.header).to_vec();
        bytes.extend_from_slice(bytemuck::cast_slice(&self.nodes));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.records));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.geometries));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.far));
        bytes
    }
}

impl Header {
    /// Where the parts of the structure lie, if its records have `record_bytes` bytes.
    pub const fn offsets(&self, record_bytes: u64) -> BvhOffsets {
        let nodes = self.node_slots as u64 * node_bytes(self.kind);
        let records = self.primitive_count as u64 * record_bytes;
        let records = records.saturating_sub(self.pairs as u64 * SAVED_BY_PAIR);
        let offsets = offsets_behind(nodes, records, self.geometry_count);
        BvhOffsets { bytes: offsets.bytes + far::bytes(self), ..offsets }
    }
}
