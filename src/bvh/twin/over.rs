//! What builders over an order that is given take from the tree that has it.

use crate::bvh::layout::{Bvh2, Child, Node, Record};
use crate::geometry::Aabb;

impl<R: Record> Bvh2<R> {
    /// The leaves in the order of their records.
    #[doc(hidden)]
    pub fn leaf_children(&self) -> Vec<Child> {
        if self.header.active == 0 {
            return Vec::new();
        }
        let of_nodes = self.nodes.iter().filter(|node| node.is_used()).flat_map(|node| node.children);
        let mut leaves: Vec<Child> = of_nodes.chain([self.header.root]).filter(Child::is_leaf).collect();
        leaves.sort_unstable_by_key(|leaf| leaf.index);
        leaves
    }

    /// The same records and slots, no tree and no costs.
    #[doc(hidden)]
    pub fn without_nodes(&self) -> Bvh2<R> {
        let mut tree = Bvh2 { nodes: vec![Node::UNUSED; self.nodes.len()], ..self.clone() };
        tree.header.root = Child { lo: Aabb::EMPTY.lo, index: 0, hi: Aabb::EMPTY.hi, count: 0 };
        tree.header.inner_nodes = 0;
        (tree.header.cost, tree.header.built_cost) = (0.0, 0.0);
        tree
    }
}
