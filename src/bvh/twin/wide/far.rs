//! What is far from the rest of a top level ([`crate::bvh::wide::far`]): the root's children then, and what the header says of them.

use crate::bvh::layout::{Bvh2, Child, Header, InstanceRecord, Record};
use crate::bvh::wide::far::{boxes_of, side_of, sides_of};
use crate::bvh::wide::layout::{Slots, WideNode};
use crate::geometry::Aabb;

/// The first child of a top level's root, if that is a node: what is near, where something is far, as codes that set that apart
/// ([`CodeBounds::Apart`](crate::bvh::codes::CodeBounds::Apart)) lay it behind.
fn first_node<N: WideNode, R: Record>(tree: &Bvh2<R>) -> Option<&Child> {
    let root = &tree.header.root;
    let is_quantised_top = N::FORM.is_quantised() && R::KIND == InstanceRecord::KIND;
    let first = (is_quantised_top && !root.is_leaf()).then(|| &tree.nodes[root.index as usize].children[0])?;
    (!first.is_leaf()).then_some(first)
}

/// The links of what the root of a wide tree holds where the first is near and all others are far from that; `None` where they are not.
pub(super) fn root_links<N: WideNode, R: Record>(tree: &Bvh2<R>) -> Option<Vec<u32>> {
    let near = first_node::<N, R>(tree)?;
    let first_link = 2 * tree.header.root.index;
    let mut links = vec![first_link];
    let mut waiting = vec![first_link + 1];
    while let Some(link) = waiting.pop() {
        let other = &tree.nodes[(link >> 1) as usize].children[(link & 1) as usize];
        if side_of(&near.bounds(), &other.bounds(), tree.header.area_scale).is_some() {
            links.push(link);
        } else if !other.is_leaf() && links.len() + waiting.len() + 2 <= N::FORM.width() as usize {
            // What lies on both sides reaches over what is near: its parts may be far.
            waiting.extend([2 * other.index + 1, 2 * other.index]);
        } else {
            return None;
        }
    }
    Some(links)
}

/// The boxes of what is far, if the root's children are such, told in the header: what they are in the binary tree, and in the wide one.
pub(super) fn tell_far<N: WideNode, R: Record>(
    tree: &Bvh2<R>,
    given: &Slots,
    written: &Slots,
    header: &mut Header,
) -> Vec<Aabb> {
    let Some(near) = first_node::<N, R>(tree) else { return Vec::new() };
    let Some(slot) = given.iter().position(|child| child.as_ref() == Some(near)) else { return Vec::new() };
    let others = given.iter().enumerate().filter(|&(at, _)| at != slot).filter_map(|(_, child)| child.as_ref());
    let boxes = boxes_of(near, others, tree.header.area_scale);
    if !boxes.is_empty() {
        header.near_node = written[slot].map_or(0, |child| child.index);
        header.far_sides = sides_of(&boxes);
    }
    boxes
}
