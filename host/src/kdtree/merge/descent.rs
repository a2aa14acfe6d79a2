//! Algorithm 11: a dynamic tree is pushed down the planes of the static tree, to the leaves that parts of it are in.
//!
//! What is outside of the static tree's cell, of which the thesis says nothing, is cut off at its faces first: were the cell
//! larger, rays beside it would walk through the static tree's planes.

use super::tree::{At, Forest, Records};
use hedgerow::geometry::Aabb;
use hedgerow::kdtree::layout::{KdContent, KdNode, halves};

/// A leaf of the static tree, or beside it. Those without a node come first, parents before children: in this order they are
/// merged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum TargetLeaf {
    /// The only leaf of a tree that holds nothing.
    Root,
    /// Beyond this face of the root's cell, from 0 to 5, and not beyond those before.
    Beyond(u8),
    /// The child of this node that is empty.
    Empty(u32),
    /// This node.
    Leaf(u32),
}

/// A part of a dynamic tree and the static leaf that it belongs to.
#[derive(Debug)]
pub(super) struct Association {
    pub place: TargetLeaf,
    /// The leaf's cell, infinite where nothing cuts it.
    pub region: Aabb,
    /// Of the leaf in the static tree.
    pub depth: u32,
    pub part: u32,
}

/// A face of a cell, and the side of it, left or right, that is outside.
pub(super) fn face(cell: &Aabb, face: u8) -> (At, usize) {
    let (axis, side) = (usize::from(face / 2), usize::from(face % 2));
    ((axis, [cell.lo, cell.hi][side][axis]), side)
}

/// `PartitionTreeWithTree`: the parts of a tree of the forest in the leaves of the static tree of `nodes` in `cell`, and beside it.
pub(super) fn partition_tree_with_tree(
    forest: &mut Forest<'_>,
    tree: u32,
    records: Records<'_>,
    (nodes, cell): (&[KdNode], &Aabb),
) -> Vec<Association> {
    let mut descent = Descent { forest, records, nodes, associations: Vec::new() };
    let mut region = Aabb { lo: [f32::NEG_INFINITY; 3], hi: [f32::INFINITY; 3] };
    if nodes.is_empty() {
        return vec![Association { place: TargetLeaf::Root, region, depth: 0, part: tree }];
    }
    let mut part = tree;
    for number in 0..6 {
        let ((axis, at), side) = face(cell, number);
        let parts = descent.forest.partition_tree_with_plane(part, records, (axis, at));
        let regions = halves(&region, axis, at);
        if let Some(part) = parts[side] {
            let (place, region) = (TargetLeaf::Beyond(number), regions[side]);
            descent.associations.push(Association { place, region, depth: 0, part });
        }
        region = regions[1 - side];
        match parts[1 - side] {
            Some(inside) => part = inside,
            None => return descent.associations,
        }
    }
    descent.push_down(Association { place: TargetLeaf::Leaf(0), region, depth: 0, part });
    descent.associations
}

struct Descent<'a, 'f> {
    forest: &'a mut Forest<'f>,
    records: Records<'a>,
    nodes: &'a [KdNode],
    associations: Vec<Association>,
}

impl Descent<'_, '_> {
    /// What is at a leaf unless its node says that it is not.
    fn push_down(&mut self, here: Association) {
        let Association { place, region, depth, part } = here;
        let node = match place {
            TargetLeaf::Leaf(node) => node,
            _ => return self.associations.push(here),
        };
        let KdContent::Inner(inner) = self.nodes[node as usize].content() else {
            return self.associations.push(here);
        };
        let parts = self.forest.partition_tree_with_plane(part, self.records, (inner.axis, inner.plane));
        for ((part, child), region) in parts.into_iter().zip(inner.children).zip(inner.halves(&region)) {
            if let Some(part) = part {
                let place = child.map_or(TargetLeaf::Empty(node), TargetLeaf::Leaf);
                self.push_down(Association { place, region, depth: depth + 1, part });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tree::tests::{one_leaf, quarters, triangle};
    use super::*;

    /// x at 2: on the left a leaf, on the right y at 2, of which the upper side is empty.
    fn nodes() -> [KdNode; 4] {
        [
            KdNode::inner(0, 2.0, 1, [false; 2]),
            KdNode::leaf(0, 1),
            KdNode::inner(1, 2.0, 3, [false, true]),
            KdNode::leaf(1, 1),
        ]
    }

    fn cell() -> Aabb {
        Aabb { lo: [0.0, -1.0, -1.0], hi: [5.0; 3] }
    }

    #[test]
    fn a_tree_comes_to_the_leaves_that_it_is_in() {
        let (records, mut forest, root) = quarters();
        let found = partition_tree_with_tree(&mut forest, root, (&records, 9.0), (&nodes(), &cell()));
        let places: Vec<_> = found.iter().map(|a| (a.place, a.depth, forest.tree(a.part).count)).collect();
        assert_eq!(places, [(TargetLeaf::Leaf(1), 1, 3), (TargetLeaf::Leaf(3), 2, 2), (TargetLeaf::Empty(2), 2, 1)]);
        assert_eq!((found[2].region.lo[..2].to_vec(), found[2].region.hi[0]), (vec![2.0, 2.0], 5.0));
    }

    #[test]
    fn what_is_beside_the_cell_is_cut_off_face_by_face() {
        let records = [triangle(-1.0, 1.0, 0.0), triangle(6.0, 7.0, 6.0), triangle(1.0, 1.5, 0.0)];
        let (mut forest, leaf) = one_leaf(&records);
        let found = partition_tree_with_tree(&mut forest, leaf, (&records, 9.0), (&nodes(), &cell()));
        let places: Vec<_> = found.iter().map(|a| (a.place, forest.tree(a.part).count)).collect();
        // What is beyond two faces is with the first.
        assert_eq!(places, [(TargetLeaf::Beyond(0), 1), (TargetLeaf::Beyond(1), 1), (TargetLeaf::Leaf(1), 2)]);
    }

    #[test]
    fn in_a_tree_of_nothing_there_is_one_place() {
        let (records, mut forest, root) = quarters();
        let found = partition_tree_with_tree(&mut forest, root, (&records, 9.0), (&[], &Aabb::EMPTY));
        assert_eq!((found.len(), found[0].place, found[0].part), (1, TargetLeaf::Root, root));
    }
}
