//! The parts of a structure below a top level, as a binary tree: what instances are opened to. The twin of `glsl/accel/parts.glsl`.

use crate::accel::Tree;
use crate::bvh::layout::{Bvh2, Child, Header, InstanceRecord, Node, Record};
use crate::bvh::wide::layout::{Wide8q, WideNode};
use crate::bvh::wide::quantised::QuantisedNode;
use crate::geometry::Aabb;

/// What a top level knows of a bottom-level structure.
#[derive(Debug, Clone, Copy)]
pub struct Below<'a> {
    pub(super) header: &'a Header,
    pub(super) nodes: Nodes<'a>,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Nodes<'a> {
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

impl Below<'_> {
    /// All that a structure holds.
    pub(super) fn whole(&self) -> Child {
        match self.nodes {
            Nodes::OfTwo(_) => self.header.root,
            Nodes::Quantised(_) => Child { count: InstanceRecord::ALL_SLOTS, ..self.header.root },
        }
    }

    /// The two parts of a part; `None` if it cannot be opened.
    pub(super) fn opened(&self, part: &Child) -> Option<[Child; 2]> {
        match self.nodes {
            Nodes::OfTwo(_) if part.is_leaf() => None,
            Nodes::OfTwo(nodes) => nodes.get(part.index as usize).map(|node| node.children),
            Nodes::Quantised(nodes) => parts_of(nodes.get(part.index as usize)?, part),
        }
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
            return Child { lo, index, hi, count: InstanceRecord::ALL_SLOTS };
        }
        Child { lo, index: part.index, hi, count: slots }
    }))
}

/// The slots of a part in which there is anything.
pub(super) fn slots_in_use(node: &QuantisedNode, part: &Child) -> Vec<usize> {
    let is_in_use = |&slot: &usize| node.node_mask() >> slot & 1 != 0 || node.count(slot) != 0;
    (0..8).filter(|slot| part.count >> slot & 1 != 0).filter(is_in_use).collect()
}

/// Slots of a quantised node cut in two, each part with its box and a bit for each of its slots; `None` if there are fewer than two.
///
/// As Guttman (1984, section 3.5.2) splits a node of an R-tree: the two slots begin that together in one box would waste most, and each
/// of the others goes to the part that grows less by it.
pub(super) fn cut_slots(node: &QuantisedNode, slots: &[usize]) -> Option<[(Aabb, u32); 2]> {
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
        let whole = Child { lo: [0.0; 3], index: 0, hi: [0.0; 3], count: InstanceRecord::ALL_SLOTS };
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
