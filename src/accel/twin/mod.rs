//! Top levels on the host, plainly: entry by entry, round by round. The twin of `glsl/accel/`: the same bytes as the device's.

pub mod rebraid;
pub mod serialize;

use super::{AccelOptions, Instance, Tree, quality};
use crate::bvh::builder::{Method, Primitives};
use crate::bvh::codes::{CodePlan, Codes};
use crate::bvh::layout::{self, Bvh2, Child, Header, Node, Record, status};
use crate::bvh::wide::layout::{Wide8q, WideNode};
use crate::bvh::wide::quantised::QuantisedNode;
use crate::bvh::{self, twin::lbvh};
use crate::geometry::Aabb;
use ash::vk;

/// What a top level knows of a bottom-level structure.
#[derive(Debug, Clone, Copy)]
pub struct Below<'a> {
    header: &'a Header,
    nodes: Nodes<'a>,
}

#[derive(Debug, Clone, Copy)]
enum Nodes<'a> {
    OfTwo(&'a [Node]),
    Quantised(&'a [QuantisedNode]),
}

impl<'a, R: Record> From<&'a Bvh2<R>> for Below<'a> {
    fn from(structure: &'a Bvh2<R>) -> Below<'a> {
        Below { header: &structure.header, nodes: Nodes::OfTwo(&structure.nodes) }
    }
}

impl<'a, R: Record> From<&'a Tree<R>> for Below<'a> {
    fn from(structure: &'a Tree<R>) -> Below<'a> {
        match structure {
            Tree::OfTwo(tree) => tree.into(),
            Tree::OfEight(tree) => tree.into(),
        }
    }
}

impl<'a, R: Record> From<&'a Wide8q<R>> for Below<'a> {
    fn from(structure: &'a Wide8q<R>) -> Below<'a> {
        Below { header: &structure.header, nodes: Nodes::Quantised(&structure.nodes) }
    }
}

/// A box in the world over an instance or a part of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// The box, or why the instance is left out: bits of [`status`], 0 for one that is inactive.
    pub bounds: Result<Aabb, u32>,
    /// Position of the instance in the input.
    pub instance: u32,
    /// Where it begins in the instance's structure: a part (`glsl/accel/parts.glsl`).
    pub start: Child,
}

/// The top level over `instances`, built as a [`Device`](super::Device) with these options builds it by these flags. `below`
/// finds the bottom-level structure at an address, if there is one.
pub fn top_level<'a>(
    instances: &[Instance],
    below: impl Fn(u64) -> Option<Below<'a>>,
    flags: vk::BuildAccelerationStructureFlagsKHR,
    options: &AccelOptions,
) -> Tree<layout::InstanceRecord> {
    let mut entries = entries(instances, &below);
    if let Some(capacity) = quality::opened_to(flags, options, entries.len() as u32) {
        rebraid::rebraid(&mut entries, instances, &below, capacity);
        let none = Entry { bounds: Err(0), instance: u32::MAX, start: Child::UNUSED };
        entries.resize(capacity as usize, none);
    }
    let boxes: Vec<_> = entries.iter().map(|entry| entry.bounds).collect();
    let is_wide = quality::is_wide(flags, options, Primitives::Instances, boxes.len() as u32);
    let mut options = quality::build_options(flags, options, Primitives::Instances, boxes.len() as u32);
    // As the builder does.
    if boxes.len() < 2 {
        options.method = Method::Lbvh;
    }
    let codes = options.codes.unwrap_or_else(|| Codes::for_count(boxes.len() as u32));
    let codes = options.bits_up_to.map_or(codes, |most| codes.by_spread(&boxes, most));
    let record = |entry: u32| record_of(&entries[entry as usize], instances, &below);
    let plan = CodePlan::new(codes, &boxes);
    let lbvh = |finish| lbvh::build_boxes(&boxes, record, codes, finish);
    let mut tree = bvh::twin::build_within(&options, codes, plan.core(), lbvh);
    tree.header.build_flags = options.build_flags;
    Tree::of(tree, is_wide)
}

/// One entry for each instance (`entries.comp`).
pub fn entries<'a>(instances: &[Instance], below: &impl Fn(u64) -> Option<Below<'a>>) -> Vec<Entry> {
    (0..instances.len() as u32).map(|i| entry_of(i, &instances[i as usize], below)).collect()
}

fn entry_of<'a>(number: u32, instance: &Instance, below: &impl Fn(u64) -> Option<Below<'a>>) -> Entry {
    let without = |why_not| Entry { bounds: Err(why_not), instance: number, start: Child::UNUSED };
    if instance.structure == 0 {
        return without(0);
    }
    let m = &instance.transform;
    let (Some(below), Some(_)) = (below(instance.structure), inverse_of(m)) else {
        return without(status::BAD_INSTANCE);
    };
    if below.header.active == 0 || below.header.status & status::UNUSABLE != 0 {
        return without(0);
    }
    let entry = below.entry_over(number, m, below.whole());
    match entry.bounds {
        Ok(b) if b.lo.iter().chain(&b.hi).all(|x| x.is_finite()) => entry,
        _ => without(status::BAD_INSTANCE),
    }
}

impl Below<'_> {
    /// All that a structure holds.
    fn whole(&self) -> Child {
        match self.nodes {
            Nodes::OfTwo(_) => self.header.root,
            Nodes::Quantised(_) => Child { count: layout::InstanceRecord::ALL_SLOTS, ..self.header.root },
        }
    }

    /// The two parts of a part; `None` if it cannot be opened.
    fn opened(&self, part: &Child) -> Option<[Child; 2]> {
        match self.nodes {
            Nodes::OfTwo(_) if part.is_leaf() => None,
            Nodes::OfTwo(nodes) => nodes.get(part.index as usize).map(|node| node.children),
            Nodes::Quantised(nodes) => parts_of(nodes.get(part.index as usize)?, part),
        }
    }

    /// A part's parts, or of one that cannot be opened itself, some levels down; the last level of slots is each by itself.
    fn down(&self, child: Child, levels: u32) -> Vec<Child> {
        let last = match self.nodes {
            Nodes::OfTwo(_) => 0,
            Nodes::Quantised(_) => levels.min(1),
        };
        match self.opened(&child) {
            Some(children) if levels > last => children.into_iter().flat_map(|c| self.down(c, levels - 1)).collect(),
            _ if last == 1 => self.by_slots(child),
            _ => vec![child],
        }
    }

    /// What is in the slots of a part, each by itself; of one that cannot be cut into slots itself.
    fn by_slots(&self, part: Child) -> Vec<Child> {
        let Nodes::Quantised(nodes) = self.nodes else { return vec![part] };
        let node = nodes.get(part.index as usize).filter(|node| node.long_leaf().is_none());
        let Some(node) = node else { return vec![part] };
        let slots = slots_in_use(node, &part);
        if slots.is_empty() {
            return vec![part];
        }
        let child = |slot| {
            let Aabb { lo, hi } = node.bounds(slot);
            Child { lo, hi, ..part }
        };
        slots.into_iter().map(child).collect()
    }

    /// The box in the world around the boxes some levels below a child.
    fn fine_box(&self, m: &[[f32; 4]; 3], child: Child, levels: u32) -> Aabb {
        self.down(child, levels).iter().fold(Aabb::EMPTY, |b, at| b.union(&transformed_box(m, at)))
    }

    fn entry_over(&self, instance: u32, m: &[[f32; 4]; 3], child: Child) -> Entry {
        // Where no axis turns away from the world's, a box's image is a box.
        let keeps_boxes = m.iter().all(|row| row[..3].iter().filter(|&&x| x != 0.0).count() <= 1);
        let levels = match self.nodes {
            _ if keeps_boxes => 0,
            Nodes::OfTwo(_) => 3,
            Nodes::Quantised(_) => 1,
        };
        let bounds = self.fine_box(m, child, levels);
        Entry { bounds: Ok(bounds), instance, start: child }
    }
}

/// The two parts of some slots of a quantised node.
fn parts_of(node: &QuantisedNode, part: &Child) -> Option<[Child; 2]> {
    if node.long_leaf().is_some() {
        return None;
    }
    let cut = cut_slots(node, &slots_in_use(node, part))?;
    Some(cut.map(|(Aabb { lo, hi }, slots)| {
        // One slot that holds a node is that node, whole.
        if slots.count_ones() == 1 && slots & node.node_mask() != 0 {
            let index = node.index(slots.trailing_zeros() as usize);
            return Child { lo, index, hi, count: layout::InstanceRecord::ALL_SLOTS };
        }
        Child { lo, index: part.index, hi, count: slots }
    }))
}

/// The slots of a part in which there is anything.
fn slots_in_use(node: &QuantisedNode, part: &Child) -> Vec<usize> {
    let is_in_use = |&slot: &usize| node.node_mask() >> slot & 1 != 0 || node.count(slot) != 0;
    (0..8).filter(|slot| part.count >> slot & 1 != 0).filter(is_in_use).collect()
}

/// Slots of a quantised node cut in two, each part with its box and a bit for each of its slots; `None` if there are fewer than two.
///
/// As Guttman (1984, section 3.5.2) splits a node of an R-tree: the two slots begin that together in one box would waste most, and each
/// of the others goes to the part that grows less by it.
fn cut_slots(node: &QuantisedNode, slots: &[usize]) -> Option<[(Aabb, u32); 2]> {
    let pairs = slots.iter().enumerate().flat_map(|(k, &i)| slots[k + 1..].iter().map(move |&j| [i, j]));
    let waste = |[i, j]: [usize; 2]| {
        let [a, b] = [i, j].map(|slot| node.bounds(slot));
        size_of(&a.union(&b)) - size_of(&a) - size_of(&b)
    };
    let mut first = [*slots.first()?, *slots.get(1)?];
    let mut most = f32::NEG_INFINITY;
    for pair in pairs {
        let waste = waste(pair);
        if waste > most {
            (first, most) = (pair, waste);
        }
    }
    let [mut one, mut other] = first.map(|slot| (node.bounds(slot), 1 << slot));
    for &slot in slots.iter().filter(|slot| !first.contains(slot)) {
        let [with_one, with_other] = [one.0, other.0].map(|b| b.union(&node.bounds(slot)));
        if size_of(&with_other) + size_of(&one.0) < size_of(&with_one) + size_of(&other.0) {
            other = (with_other, other.1 | 1 << slot);
        } else {
            one = (with_one, one.1 | 1 << slot);
        }
    }
    Some([one, other])
}

/// How large a box is in the world, whichever way its instance turns it: about the square of the sum of its edges. By its own area two long
/// halves of a long box would be as good as two short ones.
fn size_of(b: &Aabb) -> f32 {
    let [x, y, z] = b.extent();
    let edges = x + y + z;
    edges * edges
}

/// The record of an entry; all zero for one that is left out.
fn record_of<'a>(
    entry: &Entry,
    instances: &[Instance],
    below: &impl Fn(u64) -> Option<Below<'a>>,
) -> layout::InstanceRecord {
    let none = layout::InstanceRecord { instance: entry.instance, ..bytemuck::Zeroable::zeroed() };
    if entry.bounds.is_err() {
        return none;
    }
    let given = &instances[entry.instance as usize];
    let Some(below) = below(given.structure) else { return none };
    let record = layout::InstanceRecord {
        to_object: inverse_of(&given.transform).unwrap_or_default(),
        to_world: given.transform,
        structure: given.structure,
        index_and_mask: given.index_and_mask,
        offset_and_flags: given.offset_and_flags,
        ..none
    };
    record.over(&entry.start, below.header)
}

/// The box around a transformed box, not smaller by any rounding (`world_box.glsl`).
fn transformed_box(m: &[[f32; 4]; 3], child: &Child) -> Aabb {
    let slack_of_size = 2f32.powi(-21);
    let mut b = Aabb::EMPTY;
    for (row, &[x, y, z, w]) in m.iter().enumerate() {
        let axes = [x, y, z];
        let p: [f32; 3] = std::array::from_fn(|k| axes[k] * child.lo[k]);
        let q: [f32; 3] = std::array::from_fn(|k| axes[k] * child.hi[k]);
        let sum = |f: fn(f32, f32) -> f32| (f(p[0], q[0]) + f(p[1], q[1])) + f(p[2], q[2]);
        let slack = slack_of_size * (sum(|a, b| a.abs().max(b.abs())) + w.abs());
        b.lo[row] = (sum(f32::min) + w) - slack;
        b.hi[row] = (sum(f32::max) + w) + slack;
    }
    b
}

/// The inverse of an affine matrix, by its adjugate; `None` if it is not finite (`instances.glsl`).
fn inverse_of(m: &[[f32; 4]; 3]) -> Option<[[f32; 4]; 3]> {
    let is_finite = |m: &[[f32; 4]; 3]| m.iter().flatten().all(|x| x.is_finite());
    if !is_finite(m) {
        return None;
    }
    let greatest = m.iter().flat_map(|row| &row[..3]).fold(0f32, |a, x| a.max(x.abs()));
    let exponent = greatest.to_bits() >> 23 & 0xff;
    let scale = f32::from_bits((254 - exponent).clamp(1, 254) << 23);
    let [a, b, c] = m.map(|[x, y, z, _]| [x * scale, y * scale, z * scale]);
    let columns = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = a[0] * columns[0][0] + a[1] * columns[0][1] + a[2] * columns[0][2];
    let reciprocal = scale * (1.0 / determinant);
    let inverse = std::array::from_fn(|row| {
        let r = columns.map(|column| column[row] * reciprocal);
        [r[0], r[1], r[2], -(r[0] * m[0][3] + r[1] * m[1][3] + r[2] * m[2][3])]
    });
    (is_finite(&inverse) && determinant != 0.0).then_some(inverse)
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A node of leaves of one record in these boxes.
    fn node_of(boxes: &[[[f32; 3]; 2]]) -> QuantisedNode {
        let slot = |i: usize| boxes.get(i).map(|&[lo, hi]| Child { lo, index: i as u32, hi, count: 1 });
        QuantisedNode::of(&std::array::from_fn(slot))
    }

    fn slots_of_cut(boxes: &[[[f32; 3]; 2]]) -> [u32; 2] {
        let node = node_of(boxes);
        let whole = Child { lo: [0.0; 3], index: 0, hi: [0.0; 3], count: layout::InstanceRecord::ALL_SLOTS };
        cut_slots(&node, &slots_in_use(&node, &whole)).expect("more than one").map(|(_, slots)| slots)
    }

    #[test]
    fn a_node_is_cut_between_what_lies_apart() {
        let box_at = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]];
        // Left and right in turn.
        let turns: Vec<_> = (0..8).map(|i| box_at(if i % 2 == 0 { i as f32 } else { 100.0 + i as f32 })).collect();
        assert_eq!(slots_of_cut(&turns), [0b0101_0101, 0b1010_1010]);
        assert_eq!(slots_of_cut(&[box_at(0.0), box_at(9.0)]), [0b01, 0b10]);
    }

    /// Its own area would leave a long box in any place: all of its pieces are as long together.
    #[test]
    fn a_long_node_is_cut_across() {
        let pieces: Vec<_> = (0..8).map(|i| [[i as f32, 0.0, 0.0], [i as f32 + 1.0, 0.01, 0.01]]).collect();
        let [one, other] = slots_of_cut(&pieces);
        assert_eq!((one | other, one & other), (0xff, 0));
        assert!([one, other].iter().all(|slots| slots.count_ones() >= 2), "{one:#b} {other:#b}");
        assert!(one.trailing_ones() == one.count_ones(), "{one:#b} is not one end");
    }

    #[test]
    fn one_slot_is_not_cut() {
        let node = node_of(&[[[0.0; 3], [1.0; 3]]]);
        assert!(cut_slots(&node, &[0]).is_none());
    }
}
