//! What is far from the rest of a top level ([`crate::bvh::far`]): what the root holds then, and what the header says of it.

use crate::bvh::far::{MOST_PARTS, boxes_of, side_of, sides_of};
use crate::bvh::layout::{Bvh2, Child, Header, InstanceRecord, Record};
use crate::bvh::wide::layout::Slots;
use crate::geometry::Aabb;

/// The first child of a top level's root, if that is a node: what is near, where something is far, as codes that set that apart
/// ([`CodeBounds::Apart`](crate::bvh::codes::CodeBounds::Apart)) lay it behind.
fn first_node<R: Record>(tree: &Bvh2<R>) -> Option<&Child> {
    let root = &tree.header.root;
    let is_top = R::KIND == InstanceRecord::KIND && tree.header.active > 0;
    let first = (is_top && !root.is_leaf()).then(|| &tree.nodes[root.index as usize].children[0])?;
    (!first.is_leaf()).then_some(first)
}

/// The links of what the root of a top level holds where the first is near and all others are far from that; `None` where they are not.
pub(super) fn root_links<R: Record>(tree: &Bvh2<R>) -> Option<Vec<u32>> {
    let near = first_node(tree)?;
    let first_link = 2 * tree.header.root.index;
    let mut links = vec![first_link];
    let mut waiting = vec![first_link + 1];
    while let Some(link) = waiting.pop() {
        let other = child_at(tree, link);
        if side_of(&near.bounds(), &other.bounds(), tree.header.area_scale).is_some() {
            links.push(link);
        } else if !other.is_leaf() && links.len() + waiting.len() + 2 <= MOST_PARTS {
            // What lies on both sides reaches over what is near: its parts may be far.
            waiting.extend([2 * other.index + 1, 2 * other.index]);
        } else {
            return None;
        }
    }
    Some(links)
}

fn child_at<R: Record>(tree: &Bvh2<R>, link: u32) -> &Child {
    &tree.nodes[(link >> 1) as usize].children[(link & 1) as usize]
}

/// The boxes of what is far, if the root's children are such, told in the header: what they are in the binary tree, and in the wide one.
pub(super) fn tell_far<R: Record>(tree: &Bvh2<R>, given: &Slots, written: &Slots, header: &mut Header) -> Vec<Aabb> {
    let Some(near) = first_node(tree) else { return Vec::new() };
    let Some(slot) = given.iter().position(|child| child.as_ref() == Some(near)) else { return Vec::new() };
    let others = given.iter().enumerate().filter(|&(at, _)| at != slot).filter_map(|(_, child)| child.as_ref());
    let boxes = boxes_of(near, others, tree.header.area_scale);
    if !boxes.is_empty() {
        header.near_node = written[slot].map_or(0, |child| child.index);
        header.far_sides = sides_of(&boxes);
    }
    boxes
}

impl<R: Record> Bvh2<R> {
    /// The same, with what is far told in the header if it is a top level: the bytes of the step behind a build.
    #[must_use]
    pub fn with_far_told(self) -> Bvh2<R> {
        let links = root_links(&self).unwrap_or_default();
        let children: Vec<Child> = links.iter().map(|&link| *child_at(&self, link)).collect();
        let [near, others @ ..] = &children[..] else { return self.with_nothing_far() };
        let far = boxes_of(near, others.iter(), self.header.area_scale);
        let header = Header { near_node: near.index, far_sides: sides_of(&far), ..self.header };
        Bvh2 { header, far, ..self }
    }

    /// The same, with nothing told of what is far.
    pub(super) fn with_nothing_far(self) -> Bvh2<R> {
        let header = Header { near_node: 0, far_sides: 0, ..self.header };
        Bvh2 { header, far: Vec::new(), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::sah::Collapse;
    use crate::bvh::twin::{lbvh, refit};

    /// Twenty in a row, and one there.
    fn boxes(last: f32) -> Vec<Result<Aabb, u32>> {
        let at = |x: f32| Ok(Aabb { lo: [x, 0.0, 0.0], hi: [x + 0.5, 1.0, 1.0] });
        (0..20).map(|i| i as f32).chain([last]).map(at).collect()
    }

    fn record(instance: u32) -> InstanceRecord {
        InstanceRecord { instance, structure: 16, ..bytemuck::Zeroable::zeroed() }
    }

    fn top(last: f32) -> Bvh2<InstanceRecord> {
        let codes = "emc64var+apart".parse().expect("codes");
        let tree = lbvh::build_boxes(&boxes(last), record, codes, Collapse::OFF);
        tree.with_far_told()
    }

    #[test]
    fn the_header_tells_of_one_that_is_far_and_compacting_keeps_it() {
        assert_eq!((top(20.0).header.near_node, top(20.0).far.len()), (0, 0));
        for (last, side) in [(500.0, 1), (-500.0, 0)] {
            let tree = top(last);
            tree.validate().expect("valid");
            assert_eq!(tree.header.far_sides, 1 << side, "{last}");
            assert_eq!(tree.far[side], boxes(last)[20].expect("a box"), "{last}");
            let near = tree.header.near_node as usize;
            let [left, right] = tree.nodes[near].children.map(|child| child.bounds());
            assert_eq!(left.union(&right), Aabb { lo: [0.0; 3], hi: [19.5, 1.0, 1.0] }, "{last}");
            let compacted = tree.compacted();
            compacted.validate().expect("valid");
            assert_eq!((compacted.header.far_sides, &compacted.far), (1 << side, &tree.far), "{last}");
            let again = Bvh2::<InstanceRecord>::from_bytes(&compacted.to_bytes()).expect("its own bytes");
            assert_eq!(again.far, tree.far, "{last}");
        }
    }

    #[test]
    fn an_update_tells_again_what_is_far_where_something_was() {
        for (from, to, sides) in [(500.0, 900.0, 2), (500.0, -40.0, 1), (500.0, 5.0, 0), (20.0, 500.0, 0)] {
            let mut tree = top(from);
            refit::refit_boxes(&mut tree, &boxes(to), record, Collapse::OFF);
            tree.validate().expect("valid");
            assert_eq!(tree.header.far_sides, sides, "from {from} to {to}");
            assert_eq!(tree.far.is_empty(), sides == 0, "from {from} to {to}");
        }
    }
}
