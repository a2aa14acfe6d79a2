//! Leaves of references: what is cheaper as a leaf becomes one, and parts of a triangle that meet in a leaf become one reference.

use crate::bvh::bounds::{Bounds, Item};
use crate::bvh::finish::{self, Collapsed};
use crate::bvh::topology::{LEAF, Span, Topology};
use hedgerow::bvh::sah::Collapse;

/// [`finish::collapse`] of a tree over references, which are in the order of its leaves, and again for as long as leaves have parts
/// of one triangle: with fewer tests more leaves are worth it.
pub(in super::super) fn collapse(
    tree: &mut Topology,
    references: &mut Vec<Item>,
    costs: &Collapse,
    scale: f32,
) -> Collapsed {
    loop {
        let collapsed = finish::collapse(tree, references, costs, scale);
        let (merged, merged_references) = merged(tree, references);
        if merged_references.len() == references.len() {
            return collapsed;
        }
        (*tree, *references) = (merged, merged_references);
    }
}

/// The tree with one reference in place of all those to a primitive in a leaf.
fn merged(tree: &Topology, references: &[Item]) -> (Topology, Vec<Item>) {
    let count = references.len();
    let mut merged: Vec<Item> = Vec::with_capacity(count);
    let mut splits = Vec::with_capacity(tree.splits.len());
    let mut next: Vec<(Span, Option<(usize, usize)>)> = Vec::new();
    if count > 0 {
        next.push((Span::whole(count), None));
    }
    // The right child comes when the left one is done, and tells the parent how many references that had.
    while let Some((span, parent)) = next.pop() {
        if let Some((slot, first)) = parent {
            splits[slot] = (merged.len() - first) as u32;
        }
        let split = if span.count > 1 { tree.splits[span.slot as usize] } else { LEAF };
        if split == LEAF {
            let first = merged.len();
            merged.extend(merged_leaf(&references[span.primitives()]));
            splits.resize(splits.len() + merged.len() - first - 1, LEAF);
        } else {
            let [left, right] = span.children(split);
            next.push((right, Some((splits.len(), merged.len()))));
            next.push((left, None));
            splits.push(LEAF);
        }
    }
    (Topology { order: (0..merged.len() as u32).collect(), splits }, merged)
}

/// The references of a leaf, each primitive once and in the order of their first ones.
fn merged_leaf(leaf: &[Item]) -> impl Iterator<Item = Item> {
    // By primitive and place, as a leaf may have any number of them.
    let mut sorted: Vec<(u32, usize)> = leaf.iter().zip(0..).map(|(item, place)| (item.primitive(), place)).collect();
    sorted.sort_unstable();
    let mut of_primitives: Vec<(usize, Item)> = Vec::with_capacity(leaf.len());
    for parts in sorted.chunk_by(|a, b| a.0 == b.0) {
        let bounds = parts.iter().fold(Bounds::EMPTY, |all, part| all.union(leaf[part.1].bounds()));
        of_primitives.push((parts[0].1, Item::new(bounds, parts[0].0, 1)));
    }
    of_primitives.sort_unstable_by_key(|&(place, _)| place);
    of_primitives.into_iter().map(|(_, item)| item)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3A;

    #[test]
    fn parts_of_one_triangle_in_a_leaf_become_one_and_those_in_others_stay() {
        let part = |(primitive, at): (u32, f32)| {
            Item::new(Bounds { lo: Vec3A::splat(at), hi: Vec3A::splat(at + 1.0) }, primitive, 1)
        };
        let parts = [(7, 0.0), (7, 1.0), (3, 2.0), (7, 3.0), (3, 9.0), (3, 8.0)].map(part);
        // A leaf of the first four, and one of the last two.
        let tree = Topology { order: (0..6).collect(), splits: vec![4, LEAF, 0, 0, LEAF] };
        let (tree, merged) = merged(&tree, &parts);
        assert_eq!(tree, Topology { order: vec![0, 1, 2], splits: vec![2, LEAF] });
        let found: Vec<_> =
            merged.iter().map(|item| (item.primitive(), item.bounds().lo.x, item.bounds().hi.x)).collect();
        assert_eq!(found, [(7, 0.0, 4.0), (3, 2.0, 3.0), (3, 8.0, 10.0)]);
    }
}
