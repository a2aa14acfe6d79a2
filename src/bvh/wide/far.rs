//! What is far from the rest of a top level: boxes by which rays tell that they meet none of it (glsl/bvh/wide/far.glsl).
//!
//! Where something is far, the root of a quantised top level holds that, and one node over everything else, the *near* one. (The root's cells
//! are as coarse as it is large: smaller boxes of what is near would all be the same there.) A ray among what is near would visit the root for
//! nothing. So the header names the near node ([`Header::near_node`]), and boxes of what is far lie behind the records, as floats. A ray that
//! meets none of them begins at the near node, and all others at the root.
//!
//! Boxes are those of the root's other children by sides of the near one, six in all: one around all that lie farther out than half of its
//! longest edge to that side. Sides on which nothing is have no bit in [`Header::far_sides`], and a box that holds nothing.

use crate::bvh::layout::{Child, Header};
use crate::bvh::sah::SHORTEST;
use crate::geometry::Aabb;

/// Sides of a box: 2 · axis, and one more on the positive side.
pub const SIDES: usize = 6;

/// Longest edges of what is near by which all else must be apart from it.
pub(crate) const FAR_BY: f32 = 0.5;

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

/// What is far of a root's other children, by sides of the near one; empty where one of them is not, or there are none.
pub(crate) fn boxes_of<'a>(near: &Child, others: impl Iterator<Item = &'a Child>, area_scale: f32) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; SIDES];
    for other in others {
        let Some(side) = side_of(&near.bounds(), &other.bounds(), area_scale) else { return Vec::new() };
        boxes[side] = boxes[side].union(&other.bounds());
    }
    if sides_of(&boxes) == 0 { Vec::new() } else { boxes }
}
