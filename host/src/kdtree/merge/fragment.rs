//! What is put in a leaf's place: nodes and references that are numbered from 0, and go wherever there is room.

use super::tree::At;
use hedgerow::kdtree::layout::{Inner, KdContent, KdNode};
use hedgerow::kdtree::twin::Subtree;

/// A tree in the layout of a structure, but for where its nodes and references begin, and for its references: they name
/// triangles as the trees that were merged do.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Fragment {
    /// `None` of an empty one.
    pub root: Option<KdNode>,
    /// All but the root.
    pub nodes: Vec<KdNode>,
    pub references: Vec<u32>,
    pub inner_nodes: u32,
    pub leaves: u32,
    pub empty_leaves: u32,
    /// Of the deepest node, counted from the root of the structure.
    pub depth: u32,
    /// Whether a leaf should have been split and could not be, as no tree may be so deep.
    pub is_limited: bool,
}

impl Fragment {
    /// A leaf at a depth; `None` if there is nothing in it.
    pub fn leaf(&mut self, references: impl Iterator<Item = u32>, depth: u32) -> Option<KdNode> {
        let first = self.references.len();
        self.references.extend(references);
        let count = self.references.len() - first;
        (count > 0).then(|| {
            self.leaves += 1;
            self.depth = self.depth.max(depth);
            KdNode::leaf(first as u32, count as u32)
        })
    }

    /// A node whose children are there already; `None` if both are empty.
    pub fn inner(&mut self, (axis, at): At, children: [Option<KdNode>; 2]) -> Option<KdNode> {
        let empty = children.map(|child| child.is_none());
        if empty == [true; 2] {
            return None;
        }
        let first = self.nodes.len() as u32;
        self.nodes.extend(children.iter().flatten());
        self.inner_nodes += 1;
        self.empty_leaves += empty.map(u32::from).iter().sum::<u32>();
        Some(KdNode::inner(axis, at, first, empty))
    }

    /// What a builder has made, its references by their names.
    pub fn subtree(&mut self, subtree: &Subtree, name: &impl Fn(u32) -> u32, depth: u32) -> Option<KdNode> {
        match subtree {
            Subtree::Empty => None,
            Subtree::Leaf(references) => self.leaf(references.iter().map(|&reference| name(reference)), depth),
            Subtree::Together(subtree) => self.subtree(subtree, name, depth),
            Subtree::Inner { plane, children } => {
                let children = children.each_ref().map(|child| self.subtree(child, name, depth + 1));
                self.inner((plane.axis, plane.at), children)
            }
        }
    }
}

/// A node where what it names begins later.
pub(super) fn moved(node: KdNode, nodes: u32, references: u32) -> KdNode {
    match node.content() {
        KdContent::Leaf(range) => KdNode::leaf(range.start as u32 + references, range.len() as u32),
        KdContent::Inner(Inner { axis, plane, children }) => {
            let first = children[0].or(children[1]).unwrap_or(0);
            KdNode::inner(axis, plane, first + nodes, children.map(|child| child.is_none()))
        }
    }
}
