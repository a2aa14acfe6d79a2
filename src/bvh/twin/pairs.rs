//! Pairs: of triangles that lie side by side in the input, two that share an edge are one leaf from the start.
//!
//! Meshes name the two triangles of a quad, or neighbours on a strip, one behind the other. A tree that begins with such pairs has as few as
//! half of the leaves to sort and to merge, and the leaves of a finished tree hold several triangles anyway: those of a pair lie in one of
//! them, side by side. Drivers make pairs for the same reason, as their nodes hold two triangles in the space of one and a half.
//!
//! - Pairs are found among [`BLOCK`] triangles, the first of which has a number that is a multiple of that. In order, each that no other has
//!   taken takes the one behind it that shares an edge with it and makes the smallest box; of equal ones the first.
//! - It takes none whose box has more than [`LARGEST_BOX`] of the area that the two triangles' boxes have together. With 1, where a step that
//!   costs as much as a test would be no dearer than a leaf, more triangles are paired, and trees cost 1% more (docs/notes/rays.md).
//! - Whether two triangles share an edge is told by names of their vertices, words that are made of their bits: two other vertices have the
//!   same name once in four billion times, and then a pair is made that is no worse than others by its box.
//!
//! glsl/bvh/pairs.glsl is the device's side.

use super::geometry::Corners;
use super::lbvh::{self, Finish};
use crate::bvh::codes::Codes;
use crate::bvh::layout::{Bvh2, Record, Triangle, node_slots};
use crate::bvh::sah::area_scale;
use crate::geometry::Aabb;

/// Triangles among which pairs are found.
pub const BLOCK: usize = 8;
/// The most area of the box around both, as a part of the two triangles' own.
pub const LARGEST_BOX: f32 = 0.9;

/// A tree whose leaves have a primitive each, and the records of those primitives that share a leaf with one of them: of each record of the
/// tree, if there is one. Without any where nothing is paired.
pub struct Paired<R: Record> {
    tree: Bvh2<R>,
    seconds: Vec<Option<R>>,
}

impl<R: Record> From<Bvh2<R>> for Paired<R> {
    fn from(tree: Bvh2<R>) -> Paired<R> {
        Paired { tree, seconds: Vec::new() }
    }
}

impl<R: Record> Paired<R> {
    /// What `make` makes of the tree, with all records.
    pub(super) fn with_seconds(self, make: impl FnOnce(Bvh2<R>) -> Bvh2<R>) -> Bvh2<R> {
        let mut tree = make(self.tree);
        if self.seconds.is_empty() {
            return tree;
        }
        // What is left out needs no slot.
        tree.header.node_slots = node_slots(tree.header.active);
        tree.nodes.truncate(tree.header.node_slots as usize);
        let pairs = self.seconds.iter().flatten().count() as u32;
        let mut records = Vec::with_capacity(tree.records.len() + pairs as usize);
        let firsts: Vec<u32> = (tree.records.iter().zip(&self.seconds))
            .map(|(record, second)| {
                let first = records.len() as u32;
                records.extend([*record].into_iter().chain(*second));
                first
            })
            .collect();
        let of_root = std::iter::once(&mut tree.header.root);
        let of_nodes = tree.nodes.iter_mut().filter(|node| node.is_used()).flat_map(|node| &mut node.children);
        for leaf in of_root.chain(of_nodes).filter(|child| child.is_leaf()) {
            let position = leaf.index as usize;
            leaf.index = firsts[position];
            leaf.count = 1 + u32::from(self.seconds[position].is_some());
        }
        let count = records.len() as u32;
        tree.records = records;
        tree.header.active += pairs;
        tree.header.primitive_count = count;
        tree
    }
}

/// The LBVH of pairs of triangles, and of those that are in none.
pub fn build_corners(
    corners: impl Iterator<Item = Corners>,
    codes: Codes,
    finish: impl Into<Finish>,
) -> Paired<Triangle> {
    let corners: Vec<Corners> = corners.collect();
    let seconds = seconds_of(&corners);
    let is_second: Vec<bool> = seconds.iter().flatten().fold(vec![false; corners.len()], |mut is_second, &second| {
        is_second[second] = true;
        is_second
    });
    let firsts: Vec<usize> = (0..corners.len()).filter(|&i| !is_second[i]).collect();
    let box_of = |i: usize| corners[i].map(|c| Aabb::around(&c));
    let of_both = |&i: &usize| {
        let own = box_of(i)?;
        seconds[i].map_or(Ok(own), |second| Ok(own.union(&box_of(second)?)))
    };
    let boxes: Vec<Result<Aabb, u32>> = firsts.iter().map(of_both).collect();
    let record_of = |primitive: usize| {
        let [v0, v1, v2] = corners[primitive].unwrap_or([[0.0; 3]; 3]);
        Triangle { v0, v1, v2, primitive: primitive as u32 }
    };
    let tree = lbvh::build_boxes(&boxes, |first| record_of(firsts[first as usize]), codes, finish);
    let seconds = tree.records.iter().map(|record| seconds[record.primitive as usize].map(record_of)).collect();
    Paired { tree, seconds }
}

/// The second triangle of each pair, in the place of its first.
#[doc(hidden)]
pub fn seconds_of(corners: &[Corners]) -> Vec<Option<usize>> {
    let mut seconds = vec![None; corners.len()];
    for first in (0..corners.len()).step_by(BLOCK) {
        let block = &corners[first..(first + BLOCK).min(corners.len())];
        let all = block.iter().flatten().fold(Aabb::EMPTY, |all, c| all.union(&Aabb::around(c)));
        let scale = area_scale(&all);
        let mut is_taken = [false; BLOCK];
        for i in 0..block.len() {
            let mut best = (f32::INFINITY, None);
            for j in i + 1..block.len() {
                if let (Ok(a), Ok(b)) = (&block[i], &block[j])
                    && !is_taken[i]
                    && !is_taken[j]
                    && share_an_edge(a, b)
                {
                    let [a, b] = [a, b].map(|corners| Aabb::around(corners));
                    let area = a.union(&b).scaled_half_area(scale);
                    let own = a.scaled_half_area(scale) + b.scaled_half_area(scale);
                    if area <= LARGEST_BOX * own && area < best.0 {
                        best = (area, Some(j));
                    }
                }
            }
            if let (_, Some(j)) = best {
                is_taken[j] = true;
                seconds[first + i] = Some(first + j);
            }
        }
    }
    seconds
}

/// Whether two vertices or more of the second have the names of some of the first.
fn share_an_edge(first: &[[f32; 3]; 3], second: &[[f32; 3]; 3]) -> bool {
    let names = first.map(name_of);
    second.iter().filter(|&&vertex| names.contains(&name_of(vertex))).count() >= 2
}

fn name_of(vertex: [f32; 3]) -> u32 {
    let [x, y, z] = vertex.map(f32::to_bits);
    let name = (x ^ x >> 15).wrapping_mul(0x9E37_79B1).wrapping_add(y);
    (name ^ name >> 15).wrapping_mul(0x85EB_CA77).wrapping_add(z)
}
