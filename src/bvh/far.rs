//! What is far from the rest of a top level: boxes by which rays tell that they meet none of it (`glsl/bvh/far.glsl`).
//!
//! Where something is far, the root of a top level holds that, and one node over everything else, the *near* one. In nodes of eight the
//! root's cells are as coarse as it is large: smaller boxes of what is near would all be the same there. In nodes of two the test of a box
//! has slack by how far the box reaches ([`crate::trace::slab`]): rays would enter all boxes around both, and in no order.
//!
//! A ray among what is near would visit the root for nothing. So the header names the near node ([`Header::near_node`]), and boxes of what is
//! far lie behind the records, as floats. A ray that meets none of them begins at the near node, and all others at the root.
//!
//! Boxes are those of the root's other children by sides of the near one, six in all: one around all that lie farther out than half of its
//! longest edge to that side. Sides on which nothing is have no bit in [`Header::far_sides`], and a box that holds nothing. In nodes of two the
//! near node is the root's left child, and the other children are parts of the right one, seven at most: what a node of eight would hold.
//!
//! What makes nodes of eight tells it. For nodes of two it is a step behind a build, and behind an update, as boxes move. What an update brings
//! far away is told only where something was far before: memory for more bytes than a compacted copy has may not be there.

use crate::bvh::layout::{Child, Header};
use crate::bvh::sah::SHORTEST;
use crate::bvh::validate::invalid;
use crate::geometry::Aabb;
use crate::gpu::{Kernel, Step, arguments, shaders};

/// Sides of a box: 2 · axis, and one more on the positive side.
pub const SIDES: usize = 6;

/// Longest edges of what is near by which all else must be apart from it.
pub(crate) const FAR_BY: f32 = 0.5;

/// What a root is taken to hold, at most.
pub(crate) const MOST_PARTS: usize = 8;

/// The step that tells what is far of the top level in nodes of two at this address, behind a build or an update.
pub(crate) fn step(structure: u64, is_update: bool) -> Step {
    let arguments = arguments::Far { structure, is_update: u32::from(is_update) };
    Step::new("far", Kernel::new(&shaders::BVH_FAR, 1, &[]), &arguments, 1)
}

/// Bytes of the boxes of what is far, if there is any, of the structure that begins with `header`.
pub(crate) const fn bytes(header: &Header) -> u64 {
    if header.near_node == 0 { 0 } else { BYTES }
}

/// The same of a structure that has some.
pub(crate) const BYTES: u64 = (SIDES * size_of::<Aabb>()) as u64;

/// The side of `near` to which `other` lies by more than half of its longest edge, the first one; `None`: it is not far. Lengths are scaled as
/// those of areas are.
pub(crate) fn side_of(near: &Aabb, other: &Aabb, area_scale: f32) -> Option<usize> {
    let longest = near.scaled_edges(area_scale).into_iter().fold(0.0, f32::max);
    (0..SIDES).find(|side| {
        let axis = side / 2;
        let [before, behind] =
            if side % 2 == 0 { [other.hi[axis], near.lo[axis]] } else { [near.hi[axis], other.lo[axis]] };
        behind * area_scale - before * area_scale > (FAR_BY * longest).max(SHORTEST)
    })
}

/// The sides that have a box, a bit each.
pub(crate) fn sides_of(boxes: &[Aabb]) -> u32 {
    (0..).zip(boxes).filter(|(_, b)| **b != Aabb::EMPTY).map(|(side, _)| 1 << side).sum()
}

/// What the header says is true: where something is far, the root (these children) names the node over what is not, and the sides that the header
/// names, and no others, have a box, within the root's.
pub(crate) fn validate<'a>(
    header: &Header,
    boxes: &[Aabb],
    mut of_root: impl Iterator<Item = &'a Child>,
) -> crate::Result<()> {
    let &Header { near_node, far_sides, .. } = header;
    let there = if near_node == 0 { 0 } else { SIDES };
    let sides = sides_of(boxes);
    if boxes.len() != there || sides != far_sides || (sides == 0) != (near_node == 0) {
        let boxes = boxes.len();
        return invalid(format!("node {near_node} is near, sides {far_sides:#b} far, and {boxes} boxes on {sides:#b}"));
    }
    let is_named = of_root.any(|child| !child.is_leaf() && child.index == near_node);
    match boxes.iter().find(|b| **b != Aabb::EMPTY && !header.root.bounds().contains(b)) {
        _ if near_node != 0 && !is_named => invalid(format!("the near node {near_node} is no child of the root")),
        Some(b) => invalid(format!("what is far has box {b:?}, outside of the root's")),
        None => Ok(()),
    }
}

/// What is far of a root's other children, by sides of the near one; empty where one of them is not, or there are none.
pub(crate) fn boxes_of<'a>(near: &Child, others: impl Iterator<Item = &'a Child>, area_scale: f32) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; SIDES];
    for other in others {
        let Some(side) = side_of(&near.bounds(), &other.bounds(), area_scale) else { return Vec::new() };
        boxes[side] = boxes[side].union(&other.bounds());
    }
    if sides_of(&boxes) == 0 { Vec::new() } else { boxes }
}
