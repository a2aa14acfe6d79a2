//! The node of eight children in 80 bytes (Ylitie, Karras, Laine 2017, section 3; glsl/bvh/wide/quantised.glsl).
//!
//! The corners of the children's boxes are bytes in a grid of the node's own: a corner is `origin + byte · 2^exponent`, rounded
//! as floats are, with an exponent for each axis. Bytes are chosen by that same arithmetic so that the box that comes out of
//! them holds the child's; so [`crate::trace::slab`], whose proof is for any box around the triangle, holds for it. (Tracers,
//! which see it from the ray's origin, do not round as this does: that is in the proof's margin.)
//!
//! A child's slot encodes the octant that it lies in, as seen from the middle of the node (section 3.1): a tracer meets the
//! children from near to far by counting slots in an order that follows from the signs of the ray's direction. Where the children
//! of the source have an order, slots are in that order instead ([`super`]).
//!
//! Other than in the paper, a leaf's byte holds the number of its records, up to 255, and their place follows from the bytes of
//! the slots before. A longer leaf is a node of its own that holds nothing but its range.

use super::Form;
use super::layout::{Slots, WideNode};
use crate::bvh::layout::Child;
use crate::geometry::Aabb;
use bytemuck::{Pod, Zeroable};

/// A node of up to eight children. 80 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct QuantisedNode {
    /// Bits of the least corner, three floats.
    pub origin: [u32; 3],
    /// Biased exponents of the grid's cells in x, y and z, a byte each, and which of the slots are nodes, a bit each.
    /// [`QuantisedNode::LONG_LEAF`] for a long leaf.
    pub exponents_and_nodes: u32,
    /// Index of the first child that is a node; of a long leaf the number of its records.
    pub first_child: u32,
    /// The first record of the children that are leaves; of a long leaf its own.
    pub first_record: u32,
    /// Records of each slot, a byte each; 0 for nodes and for slots without a child.
    pub counts: [u32; 2],
    /// Least corners of the slots, a byte each: x, y, z.
    pub lo: [[u32; 2]; 3],
    /// Greatest corners of the slots. Slots without a child have boxes inside out.
    pub hi: [[u32; 2]; 3],
}

const _: () = assert!(size_of::<QuantisedNode>() == 80);

impl QuantisedNode {
    /// Exponents that no grid has.
    pub const LONG_LEAF: u32 = 0x00FF_FFFF;

    /// What is in a slot's byte.
    fn byte(words: [u32; 2], slot: usize) -> u32 {
        words[slot / 4] >> (8 * (slot % 4)) & 0xFF
    }

    fn set_byte(words: &mut [u32; 2], slot: usize, byte: u32) {
        words[slot / 4] |= byte << (8 * (slot % 4));
    }

    /// Which of the slots are nodes.
    pub fn node_mask(&self) -> u32 {
        self.exponents_and_nodes >> 24
    }

    /// Records of the leaf in a slot.
    pub fn count(&self, slot: usize) -> u32 {
        QuantisedNode::byte(self.counts, slot)
    }

    /// Where the child in a slot is: node, or first record.
    pub fn index(&self, slot: usize) -> u32 {
        if self.node_mask() >> slot & 1 != 0 {
            self.first_child + (self.node_mask() & ((1 << slot) - 1)).count_ones()
        } else {
            self.first_record + (0..slot).map(|before| self.count(before)).sum::<u32>()
        }
    }

    /// The least corner, and the extent of a cell of the grid.
    pub fn grid(&self) -> ([f32; 3], [f32; 3]) {
        let cell = |i: usize| f32::from_bits((self.exponents_and_nodes >> (8 * i) & 0xFF) << 23);
        (self.origin.map(f32::from_bits), std::array::from_fn(cell))
    }

    /// The least and the greatest corner of a slot's box, in cells.
    pub fn bytes(&self, slot: usize) -> [[f32; 3]; 2] {
        [self.lo, self.hi].map(|corner| corner.map(|words| QuantisedNode::byte(words, slot) as f32))
    }

    /// The box in a slot.
    pub fn bounds(&self, slot: usize) -> Aabb {
        let (origin, cell) = self.grid();
        let [lo, hi] = self.bytes(slot).map(|bytes| std::array::from_fn(|i| origin[i] + bytes[i] * cell[i]));
        Aabb { lo, hi }
    }
}

/// The biased exponent of the smallest cells of which 255 reach from `lo` to `hi`.
fn cell_exponent(lo: f32, hi: f32) -> u32 {
    // Halves, for the edges of a scene may be longer than floats go.
    let half = 0.5 * hi - 0.5 * lo;
    // hi − lo is less than 2^(exponent − 125): 2^7 cells of this size reach half as far, 2^8 of them do.
    let exponent = ((half.to_bits() >> 23) as i32 - 6).max(1) as u32;
    if lo + 255.0 * f32::from_bits(exponent << 23) >= hi { exponent } else { exponent + 1 }
}

/// How many cells `x` is from `origin`.
fn cells(x: f32, origin: f32, exponent: u32) -> f32 {
    (0.5 * x - 0.5 * origin) * f32::from_bits((255 - exponent) << 23)
}

/// The greatest byte whose corner is not above `x`.
fn byte_below(x: f32, origin: f32, exponent: u32) -> u32 {
    let byte = cells(x, origin, exponent).floor().clamp(0.0, 255.0);
    let corner = origin + byte * f32::from_bits(exponent << 23);
    // The difference is rounded: by less than a cell, for it is of 256 cells at most.
    byte as u32 - u32::from(corner > x && byte > 0.0)
}

/// The least byte whose corner is not below `x`.
fn byte_above(x: f32, origin: f32, exponent: u32) -> u32 {
    let byte = cells(x, origin, exponent).ceil().clamp(0.0, 255.0);
    let corner = origin + byte * f32::from_bits(exponent << 23);
    byte as u32 + u32::from(corner < x && byte < 255.0)
}

impl WideNode for QuantisedNode {
    const FORM: Form = Form::EightQuantised;
    const LEAF_MAX: u32 = 255;

    fn of(children: &Slots) -> Self {
        let bounds = children.iter().flatten().fold(Aabb::EMPTY, |b, child| b.union(&child.bounds()));
        let exponents: [u32; 3] = std::array::from_fn(|i| cell_exponent(bounds.lo[i], bounds.hi[i]));
        let mut node = QuantisedNode { origin: bounds.lo.map(f32::to_bits), ..QuantisedNode::empty() };
        (node.lo, node.hi) = Zeroable::zeroed();
        node.exponents_and_nodes = exponents[0] | exponents[1] << 8 | exponents[2] << 16;
        let first = |leaf: bool| children.iter().flatten().find(|c| c.is_leaf() == leaf).map_or(0, |c| c.index);
        (node.first_child, node.first_record) = (first(false), first(true));
        for (slot, child) in children.iter().enumerate() {
            for (axis, &exponent) in exponents.iter().enumerate() {
                let origin = bounds.lo[axis];
                let (lo, hi) = child.map_or((255, 0), |child| {
                    (byte_below(child.lo[axis], origin, exponent), byte_above(child.hi[axis], origin, exponent))
                });
                QuantisedNode::set_byte(&mut node.lo[axis], slot, lo);
                QuantisedNode::set_byte(&mut node.hi[axis], slot, hi);
            }
            match child {
                Some(child) if child.is_leaf() => QuantisedNode::set_byte(&mut node.counts, slot, child.count),
                Some(_) => node.exponents_and_nodes |= 1 << (24 + slot),
                None => {}
            }
        }
        node
    }

    fn of_long_leaf(first: u32, count: u32) -> Self {
        let exponents_and_nodes = QuantisedNode::LONG_LEAF;
        QuantisedNode { exponents_and_nodes, first_child: count, first_record: first, ..Zeroable::zeroed() }
    }

    fn empty() -> Self {
        QuantisedNode { exponents_and_nodes: 0x01_0101, lo: [[u32::MAX; 2]; 3], ..Zeroable::zeroed() }
    }

    fn children(&self) -> Slots {
        std::array::from_fn(|slot| {
            let is_node = self.long_leaf().is_none() && self.node_mask() >> slot & 1 != 0;
            let Aabb { lo, hi } = self.bounds(slot);
            let child = Child { lo, index: self.index(slot), hi, count: self.count(slot) };
            (is_node || child.count != 0).then_some(child)
        })
    }

    fn long_leaf(&self) -> Option<(u32, u32)> {
        (self.exponents_and_nodes == QuantisedNode::LONG_LEAF).then_some((self.first_record, self.first_child))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node_of(boxes: &[Aabb]) -> QuantisedNode {
        let mut first_record = 7;
        let mut children = [None; 8];
        for (slot, b) in boxes.iter().enumerate() {
            let count = if slot % 3 == 1 { 0 } else { slot as u32 + 1 };
            let index = if count == 0 { 40 + slot as u32 / 3 } else { first_record };
            first_record += count;
            children[slot] = Some(Child { lo: b.lo, index, hi: b.hi, count });
        }
        let node = QuantisedNode::of(&children);
        for (slot, (child, is)) in children.iter().zip(node.children()).enumerate() {
            let what = |child: &Child| (child.index, child.count);
            assert_eq!(is.as_ref().map(what), child.as_ref().map(what), "slot {slot}");
        }
        node
    }

    #[test]
    fn boxes_out_of_bytes_hold_those_that_went_in_and_are_within_a_cell_of_them() {
        let mut state = 9u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        for round in 0..20_000 {
            // From points to boxes far larger than their distance from the origin, at all scales of floats.
            let scale = 2f32.powi(round % 220 - 118);
            let far = [0.0, 1.0, 1e3, 1e6][round as usize % 4];
            let size = [1.0, 1e-3, 1e-7, 0.0][round as usize / 4 % 4];
            let boxes: Vec<Aabb> = (0..1 + round as usize % 8)
                .map(|_| {
                    let lo: [f32; 3] = std::array::from_fn(|i| scale * (far * [1.0, -1.0, 0.5][i] + unit()));
                    Aabb { lo, hi: lo.map(|x| x + scale * size * unit()) }
                })
                .collect();
            let node = node_of(&boxes);
            let around = boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
            for (slot, b) in boxes.iter().enumerate() {
                let seen = node.bounds(slot);
                assert!(seen.contains(b), "round {round}: {b:?} as {seen:?}");
                for i in 0..3 {
                    let cell = (around.hi[i] - around.lo[i]) / 127.0 + (around.hi[i].abs() + around.lo[i].abs()) * 3e-7;
                    let off = (b.lo[i] - seen.lo[i]).max(seen.hi[i] - b.hi[i]);
                    assert!(off <= cell.max(f32::MIN_POSITIVE), "round {round}: {b:?} as {seen:?}, cells of {cell}");
                }
            }
        }
    }

    #[test]
    fn boxes_as_large_as_floats_are_stay_in_theirs() {
        let most = f32::MAX;
        for (lo, hi) in [(-most, most), (-most, -most), (0.0, most), (-0.75 * most, 0.5), (most, most)] {
            let node = node_of(&[Aabb { lo: [lo; 3], hi: [hi; 3] }, Aabb { lo: [lo; 3], hi: [lo; 3] }]);
            assert!(node.bounds(0).contains(&Aabb { lo: [lo; 3], hi: [hi; 3] }), "{lo} {hi}: {:?}", node.bounds(0));
        }
    }

    #[test]
    fn slots_without_a_child_have_boxes_inside_out() {
        let node = node_of(&[Aabb { lo: [1.0; 3], hi: [2.0; 3] }]);
        assert!((1..8).all(|slot| node.bounds(slot).lo > node.bounds(slot).hi && node.count(slot) == 0));
        assert_eq!(node.children().iter().flatten().count(), 1);
    }
}
