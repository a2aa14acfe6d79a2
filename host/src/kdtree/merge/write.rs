//! `SwapLeaf` of algorithm 12, and back: trees are written in the place of static leaves, and what they overwrite is kept.
//!
//! All that is new stands behind the static nodes, references and records. A leaf that has a node has its tree's root there. An
//! empty leaf has none: its parent gets a new pair of children, to which the one that it had is moved, and the nodes below that
//! stay. Each node What is beside the static tree is parted from it by planes above its root, which moves as well. Each node of
//! the static tree is overwritten at most once, so that writing the kept ones back, in any order, restores it.

use super::descent::{TargetLeaf, face};
use super::fragment::{Fragment, moved};
use bytemuck::Zeroable;
use hedgerow::bvh::layout::status;
use hedgerow::kdtree::layout::{Inner, KdContent, KdHeader, KdNode, KdTree};
use std::collections::HashMap;

/// Writes trees into a structure.
pub(super) struct Writer<'a> {
    tree: &'a mut KdTree,
    /// Nodes of the static tree, and what they were.
    kept: &'a mut Vec<(u32, KdNode)>,
    still: KdHeader,
    /// For each object, what its first record is named in a [`Fragment`], and which record that is. Ascending.
    names: &'a [(u32, u32)],
    /// Where nodes are that were moved.
    moved: HashMap<u32, u32>,
    /// Where what is beyond each face of the static tree's cell goes.
    beyond: [u32; 6],
}

impl<'a> Writer<'a> {
    /// `tree` is the static tree, and `header` what it will say, but for what is counted.
    pub fn new(
        tree: &'a mut KdTree,
        header: KdHeader,
        kept: &'a mut Vec<(u32, KdNode)>,
        names: &'a [(u32, u32)],
    ) -> Writer<'a> {
        let still = std::mem::replace(&mut tree.header, header);
        Writer { tree, kept, still, names, moved: HashMap::new(), beyond: [0; 6] }
    }

    /// Puts the planes of these faces of the static tree's cell above its root; whether nothing is beyond is said with each.
    pub fn surround(&mut self, faces: &[(u8, bool)]) {
        let Some(&root) = self.tree.nodes.first().filter(|_| !faces.is_empty()) else { return };
        let cell = self.still.cell();
        let mut inside = 0;
        for &(number, is_empty) in faces {
            let ((axis, at), side) = face(&cell, number);
            let first = self.new_nodes(2 - usize::from(is_empty));
            let mut empty = [false; 2];
            empty[side] = is_empty;
            self.set(inside, KdNode::inner(axis, at, first, empty));
            self.beyond[usize::from(number)] = first + side as u32;
            inside = if is_empty { first } else { first + 1 - side as u32 };
        }
        self.tree.nodes[inside as usize] = root;
        self.moved.insert(0, inside);
        let header = &mut self.tree.header;
        header.inner_nodes += faces.len() as u32;
        header.empty_leaves += faces.len() as u32;
        header.depth += faces.len() as u32;
    }

    /// Puts a tree in the place of a leaf. Places must come in their order.
    pub fn swap_leaf(&mut self, place: TargetLeaf, fragment: &Fragment) {
        // Clipping may have shown that nothing touches the cell.
        let Some(root) = fragment.root else { return };
        let at = match place {
            TargetLeaf::Root => self.new_nodes(1),
            TargetLeaf::Beyond(face) => self.beyond[usize::from(face)],
            TargetLeaf::Empty(parent) => self.new_child(parent),
            TargetLeaf::Leaf(node) => self.moved.get(&node).copied().unwrap_or(node),
        };
        let header = &mut self.tree.header;
        match self.tree.nodes[at as usize].content() {
            KdContent::Leaf(range) if matches!(place, TargetLeaf::Leaf(_)) => {
                header.leaves -= 1;
                header.replaced_references += range.len() as u32;
            }
            _ => header.empty_leaves -= 1,
        }
        header.inner_nodes += fragment.inner_nodes;
        header.leaves += fragment.leaves;
        header.empty_leaves += fragment.empty_leaves;
        header.depth = header.depth.max(fragment.depth);
        if fragment.is_limited {
            header.status |= status::DEPTH_LIMITED;
        }
        let (nodes, references) = (self.tree.nodes.len() as u32, self.tree.references.len() as u32);
        self.set(at, moved(root, nodes, references));
        self.tree.nodes.extend(fragment.nodes.iter().map(|&node| moved(node, nodes, references)));
        let names = self.names;
        let record = |&name: &u32| {
            let (first, record) = names[names.partition_point(|&(first, _)| first <= name) - 1];
            name - first + record
        };
        self.tree.references.extend(fragment.references.iter().map(record));
    }

    /// What is counted once all trees are written.
    pub fn finish(self) {
        self.tree.header.node_count = self.tree.nodes.len() as u32;
        self.tree.header.reference_count = self.tree.references.len() as u32;
    }

    /// A node for the empty child of a node.
    fn new_child(&mut self, parent: u32) -> u32 {
        let parent = self.moved.get(&parent).copied().unwrap_or(parent);
        let KdContent::Inner(Inner { axis, plane, children }) = self.tree.nodes[parent as usize].content() else {
            unreachable!("what has an empty child is split");
        };
        let first = self.new_nodes(2);
        self.set(parent, KdNode::inner(axis, plane, first, [false; 2]));
        let empty = if children[0].is_none() { first } else { first + 1 };
        if let Some(child) = children[0].or(children[1]) {
            let other = if empty == first { first + 1 } else { first };
            self.tree.nodes[other as usize] = self.tree.nodes[child as usize];
            self.tree.header.replaced_nodes += 1;
            self.moved.insert(child, other);
        }
        empty
    }

    fn new_nodes(&mut self, count: usize) -> u32 {
        let first = self.tree.nodes.len();
        self.tree.nodes.resize(first + count, KdNode::zeroed());
        first as u32
    }

    fn set(&mut self, at: u32, node: KdNode) {
        let before = std::mem::replace(&mut self.tree.nodes[at as usize], node);
        if at < self.still.node_count {
            self.kept.push((at, before));
        }
    }
}

/// Makes a structure the static tree again, whose header is `still`.
pub(super) fn restore(tree: &mut KdTree, still: &KdHeader, kept: &mut Vec<(u32, KdNode)>) {
    for (at, node) in kept.drain(..) {
        tree.nodes[at as usize] = node;
    }
    tree.nodes.truncate(still.node_count as usize);
    tree.references.truncate(still.reference_count as usize);
    tree.records.truncate(still.active as usize);
    tree.header = *still;
}
